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

// The first row is the head. In the forms csv and latex, title and remarks are comments (# and
// %). Throws Error(kUsage) for a form that is not one of kTableForms.
std::string FormatTable(const std::string& title, const std::vector<TableCells>& rows,
                        const std::string& remarks, const std::string& form);

}  // namespace regrade
