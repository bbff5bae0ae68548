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

// The cells between a start, separators and an end.
std::string Joined(const Cells& row, const char* start, const char* between, const char* end) {
  std::string line = start;
  for (size_t c = 0; c < row.size(); ++c) line += (c > 0 ? between : "") + row[c];
  return line + end;
}

std::string Markdown(const std::vector<Cells>& rows) {
  std::string text = Joined(rows.front(), "| ", " | ", " |\n");
  text += "|---";
  for (size_t c = 1; c < rows.front().size(); ++c) text += "|---:";
  text += "|\n";
  for (size_t r = 1; r < rows.size(); ++r) text += Joined(rows[r], "| ", " | ", " |\n");
  return text;
}

// Cells in quotes where RFC 4180 demands them.
std::string Csv(const std::vector<Cells>& rows) {
  std::string text;
  for (Cells row : rows) {
    for (std::string& cell : row) {
      if (cell.find_first_of(",\"\n") == std::string::npos) continue;
      std::string quoted = "\"";
      for (const char c : cell) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
      cell = quoted + "\"";
    }
    text += Joined(row, "", ",", "\n");
  }
  return text;
}

// A tabular with the lines of the package booktabs.
std::string Latex(const std::vector<Cells>& rows) {
  std::string text =
      "\\begin{tabular}{l" + std::string(rows.front().size() - 1, 'r') + "}\n\\toprule\n";
  for (size_t r = 0; r < rows.size(); ++r) {
    Cells row = rows[r];
    for (std::string& cell : row) {
      std::string escaped;
      for (const char c : cell) {
        if (std::string("%_&#$").find(c) != std::string::npos) escaped += '\\';
        escaped += c;
      }
      cell = escaped;
    }
    text += Joined(row, "", " & ", " \\\\\n");
    if (r == 0) text += "\\midrule\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

// Every line as a comment.
std::string Commented(const std::string& text, const std::string& sign) {
  std::string result;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    result += sign + text.substr(at, end - at) + "\n";
    at = end + 1;
  }
  return result;
}

std::string Table(const std::string& title, const std::vector<Cells>& rows,
                  const std::string& remarks, const std::string& form) {
  if (form == "text") return title + "\n" + Align(rows) + remarks;
  if (form == "markdown") {
    return title + "\n\n" + Markdown(rows) + (remarks.empty() ? "" : "\n" + remarks);
  }
  if (form == "csv") return Commented(title, "# ") + Csv(rows) + Commented(remarks, "# ");
  if (form == "latex") return Commented(title, "% ") + Latex(rows) + Commented(remarks, "% ");
  throw UsageError("there is no table form '" + form + "'", "--table",
                   std::string("use one of ") + kTableForms);
}

std::string ConsistencyTable(const ConsistencyReport& report, const std::string& form) {
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
      remarks +=
          Concat(prefix, row.pairs_above_8bit_floor - row.perfect_pairs,
                 " pair(s) above 58.9 dB a channel, beyond the precision of 8-bit frames\n");
  }
  const std::string reading = std::string("error per pixel") +
                              (report.error_per == "pixel" ? "" : " and channel") +
                              (report.warp == "earlier" ? ", the earlier frame warped" : "");
  return Table("Consistency: TC-PSNR, higher is better (mode " + report.mode + ", flow " +
                   report.flow + ", " + reading +
                   "; 95 %: block bootstrap of the mean of dB, runs of the gap's length)",
               rows, remarks, form);
}

std::string WarpedTable(const ConsistencyReport& report, const std::string& form) {
  std::vector<Cells> rows{{"sequence", "gap", "pairs", "RMSE published", "RMSE", "compared"}};
  const bool lpips = std::ranges::any_of(report.warped, [](const WarpedRow& row) {
    return row.published.lpips || row.corrected.lpips;
  });
  if (lpips) rows[0].insert(rows[0].end(), {"LPIPS published", "LPIPS"});
  std::string remarks;
  for (const WarpedRow& row : report.warped) {
    rows.push_back({row.sequence, std::to_string(row.gap), std::to_string(row.pairs),
                    Number(row.published.rmse, 4), Number(row.corrected.rmse, 4),
                    Number(100 * row.corrected.coverage, 1) + " %"});
    if (lpips) {
      rows.back().push_back(Number(row.published.lpips, 4));
      rows.back().push_back(Number(row.corrected.lpips, 4));
    }
    if (!row.why.empty())
      remarks += Concat(row.sequence, ", gap ", row.gap, ": ", row.why, "\n");
  }
  return Table("Consistency after forward warping, lower is better (mode " + report.mode +
                   ", flow " + report.flow +
                   "; published: flow of the measured frames, mean over all pixels; else flow "
                   "of the unstyled frames, mean over the mask)",
               rows, remarks, form);
}

std::string FidelityTable(const ConsistencyReport& consistency,
                          const std::vector<FidelityRow>& fidelity, const std::string& form) {
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
  std::vector<std::string> measured;
  for (const ConsistencyRow& row : consistency.rows) measured.push_back(row.sequence);
  for (const WarpedRow& row : consistency.warped) measured.push_back(row.sequence);
  for (const std::string& sequence : measured) {
    if (std::ranges::find(seen, sequence) != seen.end()) continue;
    seen.push_back(sequence);
    if (std::ranges::find(fidelity, sequence, &FidelityRow::sequence) != fidelity.end())
      continue;
    rows.push_back({sequence, "-", "-", "-", "-", "-", "-"});
    if (lpips) rows.back().push_back("-");
    if (structure) rows.back().push_back("-");
    remarks +=
        sequence +
        ": fidelity was not measured; high consistency may come from lost colours; give the 2D "
        "method's frames and the style picture\n";
  }
  return Table("Fidelity: closeness to the 2D method's frames and to the style's colours", rows,
               remarks, form);
}

}  // namespace

std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity, const std::string& form) {
  return (consistency.warped.empty() ? ConsistencyTable(consistency, form)
                                     : WarpedTable(consistency, form)) +
         "\n" + FidelityTable(consistency, fidelity, form);
}

}  // namespace regrade
