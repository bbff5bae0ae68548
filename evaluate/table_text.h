// Tables of text for terminals and papers.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace regrade {

// "text" aligns columns for a terminal; the others are for pasting.
inline constexpr char kTableForms[] = "text|markdown|csv|latex";

using TableCells = std::vector<std::string>;

// "-" for nothing and NaN, "inf" and "-inf".
std::string TableNumber(const std::optional<double>& value, int decimals);

// "[30.88, 31.50]"
std::string IntervalText(double low, double high, int decimals);

struct TableForm {
  std::string form = "text";  // one of kTableForms
  std::string label;          // of a LaTeX table: "tab:consistency"
};

// The first row is the head. In the form csv, title and remarks are comments; in latex the
// title is the caption of a table with a label, remarks are comments, and columns without any
// value are left out. Throws Error(kUsage) for a form that is not one of kTableForms.
std::string FormatTable(const std::string& title, const std::vector<TableCells>& rows,
                        const std::string& remarks, const TableForm& form);

}  // namespace regrade
