#include "evaluate/table_text.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Columns as wide as their widest cell; the first is left-aligned, numbers are right-aligned.
std::string Align(const std::vector<TableCells>& rows) {
  std::vector<size_t> widths(rows.front().size(), 0);
  for (const TableCells& row : rows)
    for (size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  std::string text;
  for (const TableCells& row : rows) {
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
std::string Joined(const TableCells& row, const char* start, const char* between,
                   const char* end) {
  std::string line = start;
  for (size_t c = 0; c < row.size(); ++c) line += (c > 0 ? between : "") + row[c];
  return line + end;
}

std::string Markdown(const std::vector<TableCells>& rows) {
  std::string text = Joined(rows.front(), "| ", " | ", " |\n");
  text += "|---";
  for (size_t c = 1; c < rows.front().size(); ++c) text += "|---:";
  text += "|\n";
  for (size_t r = 1; r < rows.size(); ++r) text += Joined(rows[r], "| ", " | ", " |\n");
  return text;
}

// TableCells in quotes where RFC 4180 demands them.
std::string Csv(const std::vector<TableCells>& rows) {
  std::string text;
  for (TableCells row : rows) {
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
std::string Latex(const std::vector<TableCells>& rows) {
  std::string text =
      "\\begin{tabular}{l" + std::string(rows.front().size() - 1, 'r') + "}\n\\toprule\n";
  for (size_t r = 0; r < rows.size(); ++r) {
    TableCells row = rows[r];
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

}  // namespace

std::string TableNumber(const std::optional<double>& value, int decimals) {
  if (!value || std::isnan(*value)) return "-";
  if (std::isinf(*value)) return *value > 0 ? "inf" : "-inf";
  return Format("%.*f", decimals, *value);
}

std::string FormatTable(const std::string& title, const std::vector<TableCells>& rows,
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

}  // namespace regrade
