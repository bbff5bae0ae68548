// Stage "report": report.json with every number, and one page to look at.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/field/cpu/rays.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/memory.h"
#include "pipeline/report/chart_library.h"
#include "pipeline/report/cost_rows.h"
#include "pipeline/report/html.h"
#include "pipeline/report/json.h"
#include "pipeline/report/records.h"
#include "pipeline/report/run_pictures.h"
#include "pipeline/run/equivalent_command.h"
#include "pipeline/run/run_context.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

constexpr int kPagePictures = 5;  // viewpoints shown
constexpr int kJpegQuality = 85;
constexpr char kCostTable[] =
    "tradeoff/tradeoff.json";  // of `regrade tradeoff DIR --out DIR/tradeoff`

PhotosReport PhotosOf(const Capture& capture) {
  PhotosReport photos;
  photos.given = static_cast<int>(capture.statuses.size());
  photos.registered = static_cast<int>(capture.views.size());
  photos.used = static_cast<int>(std::count_if(
      capture.statuses.begin(), capture.statuses.end(),
      [](const PhotoStatus& photo) { return photo.status == PhotoState::kUsed; }));
  photos.statuses = capture.statuses;
  return photos;
}

// Of what made the results: this program's parts, and the programs that it started.
std::vector<OptionValue> VersionsOf(const Workspace& workspace) {
  std::vector<OptionValue> versions = {{"regrade", REGRADE_VERSION},
                                       {"compiler", __VERSION__},
                                       {"instructions", FastRays().name}};
  if (const auto record = workspace.Find("pose"))
    if (const JsonValue* colmap = record->metrics.Find("colmap"))
      versions.push_back({"COLMAP", colmap->AsString()});
  return versions;
}

ReportPictures PicturesOf(const RunContext& context, const RunReport& report) {
  const WorkingViews as_taken = context.Views().AsTaken();
  const Capture& capture = as_taken.capture();
  const Workspace& workspace = *context.workspace;
  ReportPictures pictures;
  pictures.title = std::filesystem::path(workspace.folder()).filename().string();
  const Image style = ReadStylePicture(context.settings.style.picture, nullptr);
  pictures.style = ReportPicture{EncodeJpeg(style, kJpegQuality), style.width, style.height};
  const int count = static_cast<int>(capture.views.size());
  const int shown = std::min(count, kPagePictures);
  for (int k = 0; k < shown; ++k) {
    const int i = shown < 2 ? 0 : k * (count - 1) / (shown - 1);
    const CaptureView& photo = capture.views[static_cast<size_t>(i)];
    const std::string name = FrameName(i);
    const Image picture = as_taken.Photo(i);
    ReportView view;
    view.name = name.substr(0, 5) + ", " + photo.file;
    view.photo =
        ReportPicture{EncodeJpeg(picture, kJpegQuality), picture.width, picture.height};
    view.source = PictureAt(workspace.Path("frames/source/" + name));
    view.views_2d = PictureAt(workspace.Path("frames/views_2d/" + name));
    view.styled = PictureAt(workspace.Path("frames/styled/" + name));
    pictures.views.push_back(std::move(view));
  }
  if (count > 0) {
    const std::string middle = FrameName(count / 2);
    const std::string common = std::string("frames/") + kCommonPrefix;
    pictures.film_poster = PictureAt(workspace.Path(common + "styled/" + middle));
    pictures.film_poster_2d = PictureAt(workspace.Path(common + "views_2d/" + middle));
  }
  pictures.has_styled_film = std::filesystem::exists(workspace.Path("styled.mp4"));
  pictures.has_wipe_film = std::filesystem::exists(workspace.Path("source_vs_styled.mp4"));
  pictures.has_views_2d_film = std::filesystem::exists(workspace.Path("views_2d.mp4"));
  pictures.heat_maps = HeatMapPictures(workspace, report);
  pictures.thumbnails = Thumbnails(workspace, capture);
  pictures.cameras = MapCameras(capture, context.settings.run.holdout);
  pictures.chart_library = ReadChartLibrary();
  pictures.run_json = DumpJson(RunFileJson("run", context), 1);
  return pictures;
}

StageOutcome WriteReport(RunContext* context) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  RunReport report = ReportFromRecords(workspace);
  report.version = REGRADE_VERSION;
  report.command = EquivalentCommand(*context);
  report.versions = VersionsOf(workspace);
  report.preset = settings.run.preset;
  report.device = "cpu";
  if (const auto record = workspace.Find("reconstruct"))
    if (const JsonValue* device = record->metrics.Find("device"))
      report.device = device->AsString();
  report.seed = settings.run.seed;
  for (const char* stage : kStageNames)
    if (const auto record = workspace.Find(stage)) report.seconds += record->seconds;
  report.peak_memory_mb = static_cast<double>(ReadMemoryStatus().peak_used >> 20);
  report.photos = PhotosOf(capture);
  for (const char* stage : {"pose", "reconstruct"})
    if (const auto record = workspace.Find(stage))
      if (const JsonValue* effects = record->metrics.Find("effects"))
        for (const EffectReport& effect : EffectsOfRecord(*effects))
          report.effects.push_back(effect);
  try {
    report.costs = ReadCostTable(workspace.Path(kCostTable));
  } catch (const Error& error) {  // a report is worth having without it
    context->console->Warn(std::string(kCostTable) + " is left out: " + error.what_failed());
  }
  const JsonValue options = context->options.Values();
  for (const auto& [name, value] : options.AsObject())
    report.options.push_back({name, value.IsString() ? value.AsString() : DumpJson(value, -1)});
  WriteJsonFile(workspace.Path("report.json"), ReportJson(report));
  WriteFileAtomically(workspace.Path("report.html"),
                      ReportHtml(report, PicturesOf(*context, report)));
  StageOutcome outcome;
  outcome.outputs = {"report.json", "report.html"};
  return outcome;
}

}  // namespace

Stage ReportStage(RunContext* context) {
  Stage stage;
  stage.name = "report";
  stage.inputs = JsonValue::Object();
  for (const char* earlier : kStageNames)
    if (std::string(earlier) != "report") stage.inputs[earlier] = context->ResultOf(earlier);
  // Stage "evaluate" leaves figures alone.
  if (const auto record = context->workspace->Find("evaluate"))
    stage.inputs["evaluate"] = record->metrics;
  const std::string costs = context->workspace->Path(kCostTable);
  if (std::filesystem::is_regular_file(costs)) stage.inputs["costs"] = HashFile(costs);
  stage.work = [context](const ProgressFunction&) { return WriteReport(context); };
  return stage;
}

}  // namespace regrade
