// Stage "report": report.json with every number, and report.html.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/field/cpu/rays.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/page/make_page.h"
#include "pipeline/program/memory.h"
#include "pipeline/report/cost_rows.h"
#include "pipeline/report/html.h"
#include "pipeline/report/json.h"
#include "pipeline/report/run_pictures.h"
#include "pipeline/run/equivalent_command.h"
#include "pipeline/run/run_context.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/run_facts.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/style_pictures.h"
#include "pipeline/stages/videos.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

constexpr int kPagePictures = 5;  // viewpoints shown
constexpr int kJpegQuality = 85;
constexpr char kCostTable[] =
    "tradeoff/tradeoff.json";  // of `regrade tradeoff DIR --out DIR/tradeoff`

// Of this program, its compiler and instruction set, and the programs that it started.
std::vector<OptionValue> VersionsOf(const StagesReport& stages) {
  std::vector<OptionValue> versions = {{"regrade", REGRADE_VERSION},
                                       {"compiler", __VERSION__},
                                       {"instructions", FastRays().name}};
  if (stages.pose && !stages.pose->colmap.empty())
    versions.push_back({"COLMAP", stages.pose->colmap});
  return versions;
}

ReportPicture Encoded(const Image& image) {
  return {EncodeJpeg(image, kJpegQuality), image.width, image.height};
}

// The films in the folder; the middle frame is the poster, of the wipe half before styling.
std::vector<ReportFilm> FilmsOf(const Workspace& workspace, const RunReport& report,
                                int views) {
  const int path_frames = report.stages.render ? report.stages.render->path_frames : 0;
  const bool common = std::filesystem::exists(
      workspace.Path(std::string("frames/") + kCommonPrefix + "styled"));
  const std::string prefix = path_frames > 0 ? kPathPrefix : common ? kCommonPrefix : "";
  const std::string middle = FrameName((path_frames > 0 ? path_frames : views) / 2);
  const auto frame = [&](const char* sequence) {
    return ImageAt(workspace.Path("frames/" + prefix + sequence + "/" + middle));
  };
  std::vector<ReportFilm> films;
  const auto add = [&](const char* file, const char* caption,
                       const std::optional<Image>& poster) {
    if (!std::filesystem::exists(workspace.Path(file))) return;
    films.push_back({file, caption, {}});
    if (poster) films.back().poster = Encoded(*poster);
  };
  const std::optional<Image> source = frame("source"), styled = frame("styled");
  std::optional<Image> wipe;
  if (source && styled && source->SameSize(*styled))
    wipe = Wipe(*source, *styled, styled->width / 2);
  add(kStyledFilm, "the styled scene", styled);
  add(kWipeFilm, "before and after, with a moving border", wipe);
  add(kViews2dFilm, "each frame recoloured by itself (2D method), for comparison",
      frame("views_2d"));
  return films;
}

ReportPictures PicturesOf(const RunContext& context, const RunReport& report) {
  const WorkingViews as_taken = context.Views().AsTaken();
  const Capture& capture = as_taken.capture();
  const Workspace &workspace = *context.style, &scene = *context.workspace;
  ReportPictures pictures;
  pictures.title = std::filesystem::path(scene.folder()).filename().string();
  if (&workspace != &scene)
    pictures.title += " · " + std::filesystem::path(workspace.folder()).filename().string();
  const Image style = StyleExampleOf(context.settings.style, nullptr);
  pictures.style = Encoded(style);
  const int count = static_cast<int>(capture.views.size());
  const int shown = std::min(count, kPagePictures);
  for (int k = 0; k < shown; ++k) {
    const int i = shown < 2 ? 0 : k * (count - 1) / (shown - 1);
    const CaptureView& photo = capture.views[i];
    const std::string name = FrameName(i);
    ReportView view;
    view.name = name.substr(0, 5) + ", " + photo.file;
    if (!capture.rendered) view.photo = Encoded(as_taken.Photo(i));
    view.source = PictureAt(workspace.Path("frames/source/" + name));
    view.views_2d = PictureAt(workspace.Path("frames/views_2d/" + name));
    view.styled = PictureAt(workspace.Path("frames/styled/" + name));
    pictures.views.push_back(std::move(view));
  }
  pictures.films = FilmsOf(workspace, report, count);
  pictures.heat_maps = HeatMapPictures(workspace, report.evaluation);
  pictures.thumbnails = Thumbnails(scene, capture);
  pictures.cameras = MapCameras(capture, context.settings.run.holdout);
  pictures.run_json = DumpJson(RunFileJson("run", context), 1);
  return pictures;
}

// scene.html beside the report; false where it is not wanted, too large or of voxels.
bool WriteScenePage(const RunContext& context, const ProgressFunction& progress) {
  constexpr int64_t kLargest = 25'000'000;  // bytes, of --page auto
  const std::string& choice = context.settings.page.page;
  const Workspace& style = *context.style;
  const std::string path = style.Path(kScenePage);
  std::filesystem::remove(path);
  if (choice == "off") return false;
  if (CountSplats(context.workspace->Path("field.npz")) == 0) {
    context.console->Detail(Concat("no page: the scene is of voxels; ", kNoPage));
    return false;
  }
  const std::string name = std::filesystem::path(style.folder()).filename().string();
  PageOptions options{.names = "styles"};
  if (choice == "auto") options.most_bytes = kLargest;
  const MadePage made = MakePage(context.workspace->folder(), {name}, options, progress);
  if (made.html.empty()) {
    context.console->Info(Format("no page: it would have %.0f MB; --page on writes it",
                                 static_cast<double>(made.bytes) / 1e6));
    return false;
  }
  for (const std::string& line : made.report) context.console->Info(line);
  WriteFileAtomically(path, made.html);
  return true;
}

StageOutcome WriteReport(RunContext* context, const ProgressFunction& progress) {
  Workspace &workspace = *context->style, &scene = *context->workspace;
  RunReport report = ReportOfRun(*context);
  report.version = REGRADE_VERSION;
  report.command = EquivalentCommand(*context);
  report.versions = VersionsOf(report.stages);
  report.peak_memory_mb = static_cast<double>(ReadMemoryStatus().peak_used >> 20);
  try {
    report.costs = ReadCostTable(scene.Path(kCostTable));
  } catch (const Error& error) {
    context->console->Warn("the report does without " + std::string(kCostTable) + ": " +
                           error.what_failed());
  }
  WriteJsonFile(workspace.Path("report.json"), ReportJson(report));
  ReportPictures pictures = PicturesOf(*context, report);
  StageOutcome outcome;
  outcome.outputs = {"report.json", "report.html"};
  if (WriteScenePage(*context, progress)) {
    pictures.scene_page = kScenePage;
    outcome.outputs.push_back(kScenePage);
  }
  WriteFileAtomically(workspace.Path("report.html"), ReportHtml(report, pictures));
  return outcome;
}

}  // namespace

Stage ReportStage(RunContext* context) {
  Stage stage;
  stage.name = "report";
  stage.inputs = JsonValue::Object();
  for (const char* earlier : kStageNames)
    if (std::string(earlier) != "report") stage.inputs[earlier] = context->ResultOf(earlier);
  stage.inputs["page"] = context->settings.page.page;
  // The results of stage "evaluate" are its metrics.
  if (const auto record = context->style->Find("evaluate"))
    stage.inputs["evaluate"] = record->metrics;
  const std::string costs = context->workspace->Path(kCostTable);
  if (std::filesystem::is_regular_file(costs)) stage.inputs["costs"] = HashFile(costs);
  stage.work = [context](const ProgressFunction& progress) {
    return WriteReport(context, progress);
  };
  return stage;
}

}  // namespace regrade
