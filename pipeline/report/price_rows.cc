#include "pipeline/report/price_rows.h"

#include <filesystem>

#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

Figure FigureAt(const JsonValue& row, const std::string& key) {
  const JsonValue* value = row.Find(key);
  if (value != nullptr && value->IsNumber()) return value->AsDouble();
  const JsonValue* why = row.Find(key + "_why");
  return Figure::Undefined(why != nullptr && why->IsString() ? why->AsString()
                                                             : "not measured");
}

PriceRow RowOf(const JsonValue& row) {
  PriceRow price;
  price.plane = row.At("plane").AsString();
  price.knob = row.At("knob").AsString();
  price.setting = row.At("setting").AsString();
  price.measure = row.At("measure").AsString();
  price.unit = row.At("unit").AsString();
  price.repeats = static_cast<int>(row.At("repeats").AsInt());
  price.seconds = FigureAt(row, "seconds");
  price.seconds_spread = FigureAt(row, "seconds_spread");
  price.cpu_seconds = FigureAt(row, "cpu_seconds");
  price.cpu_spread = FigureAt(row, "cpu_spread");
  price.accuracy = FigureAt(row, "accuracy");
  price.accuracy_spread = FigureAt(row, "accuracy_spread");
  price.error = FigureAt(row, "error");
  price.on_front = row.At("on_front").AsBool();
  if (const JsonValue* by = row.Find("dominated_by"); by != nullptr && by->IsString())
    price.dominated_by = by->AsString();
  return price;
}

}  // namespace

std::vector<PriceRow> ReadPriceList(const std::string& path) {
  std::vector<PriceRow> rows;
  if (!std::filesystem::is_regular_file(path)) return rows;
  const JsonValue file = ReadJsonFile(path);
  for (const JsonValue& row : file.At("prices").AsArray()) rows.push_back(RowOf(row));
  return rows;
}

}  // namespace regrade
