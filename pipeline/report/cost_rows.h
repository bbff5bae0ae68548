// The cost table of a tradeoff.json: its rows and their names.
#pragma once

#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/report/data.h"

namespace regrade {

inline constexpr int kTradeoffSchema = 2;  // of tradeoff.json
// Throws Error(kInput) if `file`, read from `path`, has another schema.
void CheckTradeoffSchema(const JsonValue& file, const std::string& path);

// "fit-steps 100,250,150", or the setting alone for a preset or baseline.
std::string NameOf(const CostRow& row);

// The rows of a tradeoff.json; none where there is no such file. Throws Error(kInput).
std::vector<CostRow> ReadCostTable(const std::string& path);

}  // namespace regrade
