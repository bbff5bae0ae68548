#include "pipeline/report/cost_rows.h"

#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {
namespace {

Metric MetricAt(const JsonValue& row, const std::string& key) {
  const JsonValue* value = row.Find(key);
  if (value != nullptr && value->IsNumber()) return value->AsDouble();
  const JsonValue* why = row.Find(key + "_why");
  return Metric::Undefined(why != nullptr && why->IsString() ? why->AsString()
                                                             : "not measured");
}

CostRow RowOf(const JsonValue& row) {
  CostRow cost;
  cost.benchmark = row.At("benchmark").AsString();
  cost.parameter = row.At("parameter").AsString();
  cost.setting = row.At("setting").AsString();
  cost.measure = row.At("measure").AsString();
  cost.unit = row.At("unit").AsString();
  cost.repeats = static_cast<int>(row.At("repeats").AsInt());
  cost.seconds = MetricAt(row, "seconds");
  cost.seconds_spread = MetricAt(row, "seconds_spread");
  cost.cpu_seconds = MetricAt(row, "cpu_seconds");
  cost.cpu_spread = MetricAt(row, "cpu_spread");
  cost.accuracy = MetricAt(row, "accuracy");
  cost.accuracy_spread = MetricAt(row, "accuracy_spread");
  cost.error = MetricAt(row, "error");
  cost.on_pareto_front = row.At("on_pareto_front").AsBool();
  if (const JsonValue* by = row.Find("dominated_by"); by != nullptr && by->IsString())
    cost.dominated_by = by->AsString();
  return cost;
}

}  // namespace

void CheckTradeoffSchema(const JsonValue& file, const std::string& path) {
  const JsonValue* schema = file.IsObject() ? file.Find("schema") : nullptr;
  if (schema != nullptr && *schema == JsonValue(kTradeoffSchema)) return;
  throw Error(
      ExitCode::kInput,
      (schema == nullptr ? "it has no schema" : "it has schema " + DumpJson(*schema, -1)) +
          ", and this version reads schema " + std::to_string(kTradeoffSchema),
      path, "measure again with `regrade tradeoff`");
}

std::vector<CostRow> ReadCostTable(const std::string& path) {
  std::vector<CostRow> rows;
  if (!std::filesystem::is_regular_file(path)) return rows;
  const JsonValue file = ReadJsonFile(path);
  CheckTradeoffSchema(file, path);
  for (const JsonValue& row : file.At("costs").AsArray()) rows.push_back(RowOf(row));
  return rows;
}

}  // namespace regrade
