#include "pipeline/report/json.h"

#include <string>
#include <vector>

#include "pipeline/workspace/metrics_json.h"

namespace regrade {
namespace {

constexpr int kSchema = 2;

using Object = JsonValue::Object;

JsonValue PhotosJson(const PhotosReport& photos) {
  JsonValue::Array statuses;
  for (const PhotoStatus& photo : photos.statuses)
    statuses.push_back(Object{{"file", photo.file},
                              {"status", ToString(photo.status)},
                              {"why", photo.why.empty() ? JsonValue() : photo.why}});
  return Object{{"given", photos.given},
                {"used", photos.used},
                {"registered", photos.registered},
                {"statuses", std::move(statuses)}};
}

JsonValue StagesJson(StagesReport stages) {
  JsonValue json = Object();
  stages.ForEach([&json](const char* name, const auto& stage) {
    if (!stage) return;
    JsonValue& object = json[name] = Object{{"seconds", stage->time.seconds}};
    PutMetrics(*stage, &object);
    if (stage->time.cpu_seconds) object["cpu_seconds"] = *stage->time.cpu_seconds;
  });
  return json;
}

}  // namespace

JsonValue ReportJson(const RunReport& report) {
  JsonValue json =
      Object{{"schema", kSchema},
             {"regrade", report.version},
             {"command", JsonValue::Array(report.command.begin(), report.command.end())},
             {"preset", report.preset},
             {"device", report.device},
             {"seed", report.seed},
             {"seconds", report.seconds}};
  PutMetric("peak_memory_mb", report.peak_memory_mb, &json);
  if (report.photos) json["photos"] = PhotosJson(*report.photos);
  json["effects"] = MetricsToJson(report.effects);
  json["stages"] = StagesJson(report.stages);
  PutMetrics(report.evaluation, &json);
  for (const OptionValue& version : report.versions)
    json["versions"][version.name] = version.value;
  if (!report.costs.empty()) json["costs"] = MetricsToJson(report.costs);
  return json;
}

JsonValue EvaluationJson(const RunReport& report) {
  JsonValue json =
      Object{{"schema", kSchema},
             {"regrade", report.version},
             {"command", JsonValue::Array(report.command.begin(), report.command.end())},
             {"stages", StagesJson(report.stages)}};
  PutMetrics(report.evaluation, &json);
  return json;
}

}  // namespace regrade
