#include "pipeline/report/cost_rows.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/workspace/metrics_json.h"

namespace regrade {

void CheckTradeoffSchema(const JsonValue& file, const std::string& path) {
  const JsonValue* schema = file.IsObject() ? file.Find("schema") : nullptr;
  if (schema != nullptr && *schema == JsonValue(kTradeoffSchema)) return;
  throw Error(
      ExitCode::kInput,
      (schema == nullptr ? "it has no schema" : "it has schema " + DumpJson(*schema, -1)) +
          ", and this version reads schema " + std::to_string(kTradeoffSchema),
      path, "measure again with `regrade tradeoff`");
}

std::string NameOf(const CostRow& row) {
  return row.parameter.empty() ? row.setting : row.parameter + " " + row.setting;
}

std::vector<CostRow> ReadCostTable(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) return {};
  const JsonValue file = ReadJsonFile(path);
  CheckTradeoffSchema(file, path);
  return MetricsFromJson<std::vector<CostRow>>(file.At("costs"));
}

}  // namespace regrade
