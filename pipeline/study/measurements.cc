#include "pipeline/study/measurements.h"

#include <filesystem>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kSchema = 2;

constexpr std::pair<const char*, std::optional<double> Measurement::*> kBeside[] = {
    {"ssim", &Measurement::ssim},
    {"detail_kept", &Measurement::detail_kept},
    {"lpips", &Measurement::lpips}};

Measurement FromJson(const JsonValue& row) {
  Measurement measurement;
  measurement.benchmark = row.At("benchmark").AsString();
  measurement.parameter = row.At("parameter").AsString();
  measurement.value = row.At("value").AsString();
  measurement.repeat = static_cast<int>(row.At("repeat").AsInt());
  measurement.seconds = row.At("seconds").AsDouble();
  measurement.cpu_seconds = row.At("cpu_seconds").AsDouble();
  measurement.accuracy = row.At("accuracy").AsDouble();
  for (const auto& [key, member] : kBeside)
    if (const JsonValue* value = row.Find(key)) measurement.*member = value->AsDouble();
  measurement.work = row.At("work");
  return measurement;
}

}  // namespace

JsonValue ToJson(const Measurement& measurement) {
  JsonValue json = JsonValue::Object{
      {"benchmark", measurement.benchmark}, {"parameter", measurement.parameter},
      {"value", measurement.value},         {"repeat", measurement.repeat},
      {"seconds", measurement.seconds},     {"cpu_seconds", measurement.cpu_seconds},
      {"accuracy", measurement.accuracy},   {"work", measurement.work}};
  for (const auto& [key, member] : kBeside)
    if (measurement.*member) json[key] = *(measurement.*member);
  return json;
}

MeasurementStore::MeasurementStore(const std::string& path, const std::string& fingerprint)
    : path_(path), fingerprint_(fingerprint) {
  if (!std::filesystem::is_regular_file(path)) return;
  try {
    const JsonValue file = ReadJsonFile(path);
    if (const int64_t schema = file.At("schema").AsInt(); schema != kSchema)
      throw InputError(
          Concat("it has schema ", schema, ", and this version reads schema ", kSchema));
    if (file.At("fingerprint").AsString() != fingerprint) return;
    for (const JsonValue& row : file.At("measurements").AsArray())
      all_.push_back(FromJson(row));
  } catch (const Error& error) {
    throw InputError(error.what_failed(), path,
                     "delete this file: its measurements will be repeated");
  }
}

const Measurement* MeasurementStore::Find(const Variant& variant, int repeat) const {
  for (const Measurement& m : all_)
    if (m.benchmark == variant.benchmark && m.parameter == variant.parameter &&
        m.value == variant.value && m.repeat == repeat)
      return &m;
  return nullptr;
}

void MeasurementStore::Add(const Measurement& measurement) {
  all_.push_back(measurement);
  JsonValue::Array rows;
  for (const Measurement& m : all_) rows.push_back(ToJson(m));
  WriteJsonFile(path_, JsonValue::Object{{"schema", kSchema},
                                         {"fingerprint", fingerprint_},
                                         {"measurements", std::move(rows)}});
}

}  // namespace regrade
