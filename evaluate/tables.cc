#include "evaluate/tables.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "evaluate/table_text.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

std::string Range(const std::optional<Interval>& interval, int decimals) {
  return interval ? IntervalText(interval->low, interval->high, decimals) : "-";
}

std::string NameIn(const TableContext& context, const std::string& sequence) {
  const auto found = context.labels.find(sequence);
  return found == context.labels.end() ? sequence : found->second;
}

// "; 50 frames of 640 x 480 px; regrade 0.2.0", for a title.
std::string Provenance(const ConsistencyReport& report, const TableContext& context) {
  std::string text;
  if (report.width > 0)
    text +=
        Concat("; ", report.frames, " frames of ", report.width, " x ", report.height, " px");
  if (!context.version.empty()) text += "; regrade " + context.version;
  return text;
}

std::string Motion(const ConsistencyReport& report, const TableContext& context) {
  return (context.protocol.empty() ? "" : "protocol " + context.protocol + ", ") + "mode " +
         report.mode + ", flow " + report.flow;
}

// Heads of the columns of a difference, which a table has where it compares with a sequence.
void AddDifferenceHead(const ConsistencyReport& report, const TableContext& context,
                       TableCells* head) {
  if (report.compared_with.empty()) return;
  head->push_back("minus " + NameIn(context, report.compared_with));
  head->push_back("95 %");
}

void AddDifference(const ConsistencyReport& report,
                   const std::optional<PairedDifference>& difference, int decimals,
                   TableCells* row) {
  if (report.compared_with.empty()) return;
  const PairedDifference none, &shown = difference ? *difference : none;
  row->push_back(TableNumber(shown.mean, decimals));
  row->push_back(Range(shown.interval, decimals));
}

std::string ConsistencyTable(const ConsistencyReport& report, const TableContext& context) {
  std::vector<TableCells> rows{{"sequence", "gap", "pairs", "undefined", "mean of dB", "95 %"}};
  AddDifferenceHead(report, context, &rows[0]);
  rows[0].insert(rows[0].end(), {"dB of mean", "without mask", "compared"});
  std::string remarks;
  for (const ConsistencyRow& row : report.rows) {
    const std::string name = NameIn(context, row.sequence);
    rows.push_back({name, std::to_string(row.gap), std::to_string(row.pairs),
                    std::to_string(row.undefined_pairs), TableNumber(row.tc_psnr_mean_db, 2),
                    Range(row.tc_psnr_interval_db, 2)});
    AddDifference(report, row.difference, 2, &rows.back());
    rows.back().insert(rows.back().end(), {TableNumber(row.tc_psnr_of_mean_db, 2),
                                           TableNumber(row.tc_psnr_unmasked_mean_db, 2),
                                           TableNumber(100 * row.coverage, 1) + " %"});
    const std::string prefix = Concat(name, ", gap ", row.gap, ": ");
    if (!row.why.empty()) remarks += prefix + row.why + "\n";
    if (row.perfect_pairs > 0)
      remarks += Concat(prefix, row.perfect_pairs,
                        " identical pair(s) at inf dB, not in the mean of dB\n");
    if (row.low_coverage_pairs > 0)
      remarks +=
          Concat(prefix, row.low_coverage_pairs, " pair(s) with few comparable pixels\n");
    if (row.pairs_above_8bit_floor > row.perfect_pairs)
      remarks +=
          Concat(prefix, row.pairs_above_8bit_floor - row.perfect_pairs,
                 " pair(s) above 58.9 dB a channel, beyond the precision of 8-bit frames\n");
  }
  for (const std::string& remark : context.remarks) remarks += remark + "\n";
  const std::string reading = std::string("error per pixel") +
                              (report.error_per == "pixel" ? "" : " and channel") +
                              (report.warp == "earlier" ? ", the earlier frame warped" : "");
  return FormatTable(
      "Consistency: TC-PSNR in dB, higher is better (" + Motion(report, context) + ", " +
          reading + Provenance(report, context) +
          "; 95 %: block bootstrap over pairs, runs of the gap's length; without mask: mean "
          "of dB over all pixels that stay in the frame)",
      rows, remarks, {context.form, "tab:consistency"});
}

std::string WarpedTable(const ConsistencyReport& report, const TableContext& context) {
  std::vector<TableCells> rows{{"sequence", "gap", "pairs", "RMSE published", "RMSE"}};
  AddDifferenceHead(report, context, &rows[0]);
  rows[0].push_back("compared");
  const bool lpips = std::ranges::any_of(report.warped, [](const WarpedRow& row) {
    return row.published.lpips || row.corrected.lpips;
  });
  if (lpips) rows[0].insert(rows[0].end(), {"LPIPS published", "LPIPS"});
  std::string remarks;
  for (const WarpedRow& row : report.warped) {
    const std::string name = NameIn(context, row.sequence);
    rows.push_back({name, std::to_string(row.gap), std::to_string(row.pairs),
                    TableNumber(row.published.rmse, 4), TableNumber(row.corrected.rmse, 4)});
    AddDifference(report, row.difference, 4, &rows.back());
    rows.back().push_back(TableNumber(100 * row.corrected.coverage, 1) + " %");
    if (lpips) {
      rows.back().push_back(TableNumber(row.published.lpips, 4));
      rows.back().push_back(TableNumber(row.corrected.lpips, 4));
    }
    if (!row.why.empty()) remarks += Concat(name, ", gap ", row.gap, ": ", row.why, "\n");
  }
  for (const std::string& remark : context.remarks) remarks += remark + "\n";
  return FormatTable(
      "Consistency after forward warping, lower is better (" + Motion(report, context) +
          Provenance(report, context) +
          "; published: flow of the measured frames, mean over all pixels; else flow "
          "of the unstyled frames, mean over the mask)",
      rows, remarks, {context.form, "tab:consistency"});
}

// A column of the table of fidelity; those of kOptionalColumns are left out where no row has a
// value.
struct FidelityColumn {
  const char* name;
  std::optional<double> FidelityRow::*value;
  int decimals;
};

constexpr FidelityColumn kColumns[] = {
    {"PSNR to 2D", &FidelityRow::psnr_to_2d_db, 2},
    {"hue std", &FidelityRow::hue_std, 3},
    {"of 2D", &FidelityRow::hue_std_2d, 3},
    {"chroma", &FidelityRow::chroma, 2},
    {"of 2D", &FidelityRow::chroma_2d, 2},
    {"SW to style", &FidelityRow::sliced_wasserstein_to_style, 4}};
constexpr FidelityColumn kOptionalColumns[] = {{"LPIPS to 2D", &FidelityRow::lpips_to_2d, 4},
                                               {"structure", &FidelityRow::structure, 3},
                                               {"edge SSIM", &FidelityRow::edge_ssim, 4}};

std::string FidelityTable(const ConsistencyReport& consistency,
                          const std::vector<FidelityRow>& fidelity,
                          const TableContext& context) {
  std::vector<FidelityColumn> columns(std::begin(kColumns), std::end(kColumns));
  for (const FidelityColumn& column : kOptionalColumns)
    if (std::ranges::any_of(
            fidelity, [&](const FidelityRow& row) { return (row.*column.value).has_value(); }))
      columns.push_back(column);
  std::vector<TableCells> rows{{"sequence"}};
  for (const FidelityColumn& column : columns) rows[0].push_back(column.name);
  for (const FidelityRow& row : fidelity) {
    rows.push_back({NameIn(context, row.sequence)});
    for (const FidelityColumn& column : columns)
      rows.back().push_back(TableNumber(row.*column.value, column.decimals));
  }
  std::string remarks;
  std::vector<std::string> seen;
  std::vector<std::string> measured;
  for (const ConsistencyRow& row : consistency.rows) measured.push_back(row.sequence);
  for (const WarpedRow& row : consistency.warped) measured.push_back(row.sequence);
  for (const std::string& sequence : measured) {
    if (std::ranges::find(seen, sequence) != seen.end()) continue;
    seen.push_back(sequence);
    if (std::ranges::find(fidelity, sequence, &FidelityRow::sequence) != fidelity.end())
      continue;
    rows.push_back({NameIn(context, sequence)});
    rows.back().resize(rows[0].size(), "-");
    remarks +=
        NameIn(context, sequence) +
        ": fidelity was not measured; high consistency may come from lost colours; give the 2D "
        "method's frames and the style picture\n";
  }
  return FormatTable(
      "Fidelity: closeness to the 2D method's frames and to the style's colours" +
          Provenance(consistency, context),
      rows, remarks, {context.form, "tab:fidelity"});
}

}  // namespace

std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity,
                         const TableContext& context) {
  return (consistency.warped.empty() ? ConsistencyTable(consistency, context)
                                     : WarpedTable(consistency, context)) +
         "\n" + FidelityTable(consistency, fidelity, context);
}

}  // namespace regrade
