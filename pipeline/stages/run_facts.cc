#include "pipeline/stages/run_facts.h"

#include <algorithm>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/report/records.h"

namespace regrade {
namespace {

PhotosReport PhotosOf(const Capture& capture) {
  PhotosReport photos;
  photos.given = static_cast<int>(capture.statuses.size());
  photos.registered = static_cast<int>(capture.views.size());
  photos.used = static_cast<int>(
      std::ranges::count(capture.statuses, PhotoState::kUsed, &PhotoStatus::status));
  photos.statuses = capture.statuses;
  return photos;
}

}  // namespace

RunReport ReportOfRun(const RunContext& context) {
  const RunSettings& settings = context.settings;
  const Workspace& scene = *context.workspace;
  const Capture capture = ReadCapture(scene.Path("poses"));
  RunReport report = ReportFromRecords(scene, *context.style);
  report.preset = settings.run.preset;
  if (report.stages.reconstruct) report.device = report.stages.reconstruct->device;
  report.seed = settings.run.seed;
  for (const char* stage : kStageNames)
    if (const auto record = context.FolderOf(stage).Find(stage))
      report.seconds += record->seconds;
  report.photos = PhotosOf(capture);
  report.spacing = SpacingOf(capture);
  for (const char* stage : {"pose", "reconstruct"})
    if (const auto record = scene.Find(stage))
      if (const JsonValue* effects = record->metrics.Find("effects"))
        for (const EffectReport& effect : EffectsOfRecord(*effects))
          report.effects.push_back(effect);
  const JsonValue options = context.options.Values();
  for (const auto& [name, value] : options.AsObject())
    report.options.push_back({name, value.IsString() ? value.AsString() : DumpJson(value, -1)});
  return report;
}

}  // namespace regrade
