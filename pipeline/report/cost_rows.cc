#include "pipeline/report/cost_rows.h"

#include <filesystem>

#include "pipeline/workspace/metrics_json.h"

namespace regrade {

std::vector<CostRow> ReadCostTable(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) return {};
  return MetricsFromJson<std::vector<CostRow>>(ReadJsonFile(path).At("costs"));
}

}  // namespace regrade
