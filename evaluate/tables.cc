#include "evaluate/tables.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/base/error.h"

namespace regrade {
namespace {

std::string Number(const std::optional<double>& value, int decimals) {
  if (!value || std::isnan(*value)) return "-";
  if (std::isinf(*value)) return *value > 0 ? "inf" : "-inf";
  return Format("%.*f", decimals, *value);
}

std::string Range(const std::optional<Interval>& interval) {
  return interval ? Number(interval->low, 2) + ".." + Number(interval->high, 2) : "-";
}

using Cells = std::vector<std::string>;

// Columns as wide as their widest cell; the first is left-aligned, numbers are right-aligned.
std::string Align(const std::vector<Cells>& rows) {
  std::vector<size_t> widths(rows.front().size(), 0);
  for (const Cells& row : rows)
    for (size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  std::string text;
  for (const Cells& row : rows) {
    std::string line;
    for (size_t c = 0; c < row.size(); ++c) {
      const std::string pad(widths[c] - row[c].size(), ' ');
      line += (c > 0 ? "  " : "") + (c > 0 ? pad + row[c] : row[c] + pad);
    }
    text += line + "\n";
  }
  return text;
}

std::string ConsistencyTable(const ConsistencyReport& report) {
  std::vector<Cells> rows{{"sequence", "gap", "pairs", "undefined", "mean of dB", "95 %",
                           "dB of mean", "compared"}};
  std::string remarks;
  for (const ConsistencyRow& row : report.rows) {
    rows.push_back({row.sequence, std::to_string(row.gap), std::to_string(row.pairs),
                    std::to_string(row.undefined_pairs), Number(row.tc_psnr_mean_db, 2),
                    Range(row.tc_psnr_interval_db), Number(row.tc_psnr_of_mean_db, 2),
                    Number(100 * row.coverage, 1) + " %"});
    const std::string prefix = Concat(row.sequence, ", gap ", row.gap, ": ");
    if (!row.why.empty()) remarks += prefix + row.why + "\n";
    if (row.perfect_pairs > 0)
      remarks += Concat(prefix, row.perfect_pairs,
                        " identical pair(s) at inf dB, not in the mean of dB\n");
    if (row.low_coverage_pairs > 0)
      remarks +=
          Concat(prefix, row.low_coverage_pairs, " pair(s) with few comparable pixels\n");
    if (row.pairs_above_8bit_floor > row.perfect_pairs)
      remarks += Concat(prefix, row.pairs_above_8bit_floor - row.perfect_pairs,
                        " pair(s) above 58.9 dB, beyond the precision of 8-bit frames\n");
  }
  return "Consistency: TC-PSNR, higher is better (mode " + report.mode + ", flow " +
         report.flow +
         ", error per pixel and channel; 95 %: block bootstrap of the mean of dB, runs of "
         "the gap's length)\n" +
         Align(rows) + remarks;
}

std::string FidelityTable(const ConsistencyReport& consistency,
                          const std::vector<FidelityRow>& fidelity) {
  std::vector<Cells> rows{
      {"sequence", "PSNR to 2D", "hue std", "of 2D", "chroma", "of 2D", "SW to style"}};
  const bool lpips = std::ranges::any_of(
      fidelity, [](const FidelityRow& f) { return f.lpips_to_2d.has_value(); });
  if (lpips) rows[0].push_back("LPIPS to 2D");
  const bool structure = std::ranges::any_of(
      fidelity, [](const FidelityRow& f) { return f.structure.has_value(); });
  if (structure) rows[0].push_back("structure");
  for (const FidelityRow& row : fidelity) {
    rows.push_back({row.sequence, Number(row.psnr_to_2d_db, 2), Number(row.hue_std, 3),
                    Number(row.hue_std_2d, 3), Number(row.chroma, 2), Number(row.chroma_2d, 2),
                    Number(row.sliced_wasserstein_to_style, 4)});
    if (lpips) rows.back().push_back(Number(row.lpips_to_2d, 4));
    if (structure) rows.back().push_back(Number(row.structure, 3));
  }
  std::string remarks;
  std::vector<std::string> seen;
  for (const ConsistencyRow& row : consistency.rows) {
    if (std::ranges::find(seen, row.sequence) != seen.end()) continue;
    seen.push_back(row.sequence);
    if (std::ranges::find(fidelity, row.sequence, &FidelityRow::sequence) != fidelity.end())
      continue;
    rows.push_back({row.sequence, "-", "-", "-", "-", "-", "-"});
    if (lpips) rows.back().push_back("-");
    if (structure) rows.back().push_back("-");
    remarks +=
        row.sequence +
        ": fidelity was not measured; high consistency may come from lost colours; give the 2D "
        "method's frames and the style picture\n";
  }
  return "Fidelity: closeness to the 2D method's frames and to the style's colours\n" +
         Align(rows) + remarks;
}

}  // namespace

std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity) {
  return ConsistencyTable(consistency) + "\n" + FidelityTable(consistency, fidelity);
}

}  // namespace regrade
