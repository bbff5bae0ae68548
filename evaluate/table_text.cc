#include "evaluate/table_text.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Characters of a text in UTF-8.
size_t WidthOf(const std::string& text) {
  return static_cast<size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

// Columns as wide as their widest cell; the first is left-aligned, numbers are right-aligned.
std::string Align(const std::vector<TableCells>& rows) {
  std::vector<size_t> widths(rows.front().size(), 0);
  for (const TableCells& row : rows)
    for (size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], WidthOf(row[c]));
  std::string text;
  for (const TableCells& row : rows) {
    std::string line;
    for (size_t c = 0; c < row.size(); ++c) {
      const std::string pad(widths[c] - WidthOf(row[c]), ' ');
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

std::string Markdown(std::vector<TableCells> rows) {
  for (TableCells& row : rows)
    for (std::string& cell : row)
      for (size_t at = 0; (at = cell.find('|', at)) != std::string::npos; at += 2)
        cell.insert(at, "\\");
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

// Text as LaTeX prints it.
std::string EscapedForLatex(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (std::string("%_&#${}").find(c) != std::string::npos)
      escaped += std::string("\\") + c;
    else if (c == '\\')
      escaped += "\\textbackslash{}";
    else if (c == '~')
      escaped += "\\textasciitilde{}";
    else if (c == '^')
      escaped += "\\textasciicircum{}";
    else if (c == '<')
      escaped += "\\textless{}";
    else if (c == '>')
      escaped += "\\textgreater{}";
    else if (c == '|')
      escaped += "\\textbar{}";
    else if (static_cast<unsigned char>(c) < ' ')
      escaped += ' ';
    else
      escaped += c;
  }
  return escaped;
}

// A cell of numbers: with signs and infinity as in formulas.
std::string LatexNumber(const std::string& cell) {
  if (cell == "-") return "--";
  if (cell == "inf") return "$\\infty$";
  if (cell == "-inf") return "$-\\infty$";
  std::string text;
  for (size_t i = 0; i < cell.size(); ++i) {
    const bool sign = cell[i] == '-' && i + 1 < cell.size() &&
                      std::isdigit(static_cast<unsigned char>(cell[i + 1])) != 0;
    text += sign ? "$-$" : EscapedForLatex(cell.substr(i, 1));
  }
  return text;
}

// Without the columns that have no value in any row.
std::vector<TableCells> WithoutEmptyColumns(const std::vector<TableCells>& rows) {
  std::vector<TableCells> kept(rows.size());
  for (size_t c = 0; c < rows.front().size(); ++c) {
    const auto empty = [c](const TableCells& row) { return row[c] == "-" || row[c].empty(); };
    if (c > 0 && rows.size() > 1 && std::all_of(rows.begin() + 1, rows.end(), empty)) continue;
    for (size_t r = 0; r < rows.size(); ++r) kept[r].push_back(rows[r][c]);
  }
  return kept;
}

// A table with the lines of the package booktabs.
std::string Latex(const std::string& caption, const std::vector<TableCells>& all,
                  const std::string& label) {
  const std::vector<TableCells> rows = WithoutEmptyColumns(all);
  std::string text = "\\begin{table}\n\\centering\n\\caption{" + EscapedForLatex(caption) +
                     "}\n\\label{" + label + "}\n\\begin{tabular}{l" +
                     std::string(rows.front().size() - 1, 'r') + "}\n\\toprule\n";
  for (size_t r = 0; r < rows.size(); ++r) {
    TableCells row = rows[r];
    for (size_t c = 0; c < row.size(); ++c)
      row[c] = r > 0 && c > 0 ? LatexNumber(row[c]) : EscapedForLatex(row[c]);
    // After a line's end these would be arguments of it.
    if (row[0].starts_with('[') || row[0].starts_with('*')) row[0] = "{}" + row[0];
    text += Joined(row, "", " & ", " \\\\\n");
    if (r == 0) text += "\\midrule\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n\\end{table}\n";
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

std::string IntervalText(double low, double high, int decimals) {
  return "[" + TableNumber(low, decimals) + ", " + TableNumber(high, decimals) + "]";
}

std::string FormatTable(const std::string& title, const std::vector<TableCells>& rows,
                        const std::string& remarks, const TableForm& of) {
  const std::string& form = of.form;
  if (form == "text") return title + "\n" + Align(rows) + remarks;
  if (form == "markdown") {
    return title + "\n\n" + Markdown(rows) + (remarks.empty() ? "" : "\n" + remarks);
  }
  if (form == "csv") return Commented(title, "# ") + Csv(rows) + Commented(remarks, "# ");
  if (form == "latex") return Latex(title, rows, of.label) + Commented(remarks, "% ");
  throw UsageError("there is no table form '" + form + "'", "--format",
                   std::string("use one of ") + kTableForms);
}

}  // namespace regrade
