// regrade contact-sheet: what each way of styling makes of a reconstruction, on one picture.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/image/color_statistics.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/images/contact_sheet.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/workspace/workspace.h"
#include "stylize/field/apply_network.h"
#include "stylize/image/monge_kantorovich.h"
#include "stylize/linear_map.h"
#include "stylize/training/train_network.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct SheetOptions {
  std::string out;
  int views = 3;
  int size = 320;
  int steps = 0;
  int holdout = 8;
  std::string device = "auto";
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the picture to write, a PNG file"});
    bind("views", views,
         {.unit = "photos", .help = "of each style, evenly spread", .min = 1, .max = 100});
    bind("size", size,
         {.unit = "pixels",
          .help = "longer side of each picture on the sheet, and of those that are learned "
                  "from; time grows with its square",
          .min = 64,
          .max = 4096});
    bind("steps", steps,
         {.unit = "steps",
          .help = "of each network; 0 takes those of its recipe",
          .min = 0,
          .max = 1e6});
    bind("holdout", holdout,
         {.unit = "photos",
          .help = "as in `regrade run`, by default as in the run of DIR",
          .min = 0,
          .max = 1000});
    bind("device", device, {.help = "where networks learn", .choices = "auto|cpu|cuda"});
    bind("dry-run", dry_run, {.help = "say what would be done, and do nothing"});
  }
};

constexpr int kStyledBasis = 9;

const std::vector<std::string> kColumns = {"photo", "2D method", "linear map", "paper recipe",
                                           "standard recipe"};

Image Clipped(Image image) {
  for (float& v : image.pixels) v = std::isfinite(v) ? std::clamp(v, 0.0f, 1.0f) : v;
  return image;
}

// What the 2D method makes of our renders is what a frame of the styled field should be; of
// photos, where it knows these alone.
std::string PsnrCaption(const Image& a, const Image& b, bool of_photos) {
  double sum = 0;
  int64_t count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const double d = a.pixels[i] - b.pixels[i];
    if (std::isfinite(d)) sum += d * d, ++count;
  }
  char text[64];
  const double mse = sum / static_cast<double>(std::max<int64_t>(1, count));
  std::snprintf(text, sizeof text, "%.1f dB to 2D%s", -10 * std::log10(std::max(mse, 1e-12)),
                of_photos ? " of photo" : "");
  return text;
}

// Everything about the scene that all styles share.
struct Scene {
  Capture capture;
  StoredField stored;
  Backend backend = Backend::kCpu;         // where networks learn
  std::vector<int> training_views, shown;  // views
  std::vector<Camera> cameras;             // of all views
  std::vector<Image> photos;               // of all views that are taught or shown
  std::vector<Image> kept;                 // what --photo-masks leaves of each, or empty
};

Scene ReadScene(const Workspace& workspace, const SheetOptions& sheet) {
  Scene scene;
  scene.capture = ReadCapture(workspace.Path("poses"));
  scene.stored = ReadFieldFile(workspace.Path("field.npz"));
  // As a run does it: what differs from view to view needs directions.
  scene.stored.field.appearance =
      PadShBasis(std::move(scene.stored.field.appearance), kStyledBasis);
  scene.training_views = ViewIndices(scene.capture, sheet.holdout, false);
  if (scene.training_views.empty())
    scene.training_views = ViewIndices(scene.capture, sheet.holdout, true);
  const int count = std::min(sheet.views, static_cast<int>(scene.training_views.size()));
  for (int k = 0; k < count; ++k)
    scene.shown.push_back(
        scene.training_views[(2 * static_cast<size_t>(k) + 1) * scene.training_views.size() /
                             (2 * static_cast<size_t>(count))]);
  const PhotoGains gains = RecordedGains(workspace, scene.capture);
  for (size_t i = 0; i < scene.capture.views.size(); ++i) {
    const CaptureView& view = scene.capture.views[i];
    scene.cameras.push_back(WorkingCamera(view.camera, sheet.size,
                                          scene.stored.field_from_world, scene.stored.ndc));
    scene.photos.push_back(ReadWorkingPhoto(view, sheet.size, gains.Of(static_cast<int>(i))));
    scene.kept.push_back(ReadWorkingMask(view, sheet.size));
  }
  return scene;
}

// Renders of the shown views, clipped as pictures are.
std::vector<Image> Shown(const Scene& scene, const RadianceField& field) {
  const FastGrid grid = MakeFastGrid(field);
  std::vector<Image> frames;
  for (const int i : scene.shown)
    frames.push_back(Clipped(
        RenderView(grid, scene.cameras[static_cast<size_t>(i)], MarchOptions{field.step})
            .color));
  return frames;
}

TrainNetworkResult Train(const Scene& scene, const RadianceField& field,
                         const std::vector<StyledTrainingView>& views, const SceneColorMap& map,
                         const std::string& recipe, int steps, uint64_t seed,
                         const ProgressFunction& progress) {
  TrainNetworkOptions options;
  ApplyStyleRecipe(recipe, &options);
  options.seed = seed;
  if (steps > 0) options.steps = steps;
  TrainingHooks hooks;
  hooks.progress = progress;
  const bool on_device = scene.backend == Backend::kCuda;
  DeviceGrid grid;
  if (on_device) grid = UploadGrid(MakeFastGrid(field));
  return TrainNetwork(field, views, map, MarchOptions{scene.stored.field.step}, options, hooks,
                      nullptr, on_device ? &grid : nullptr);
}

void AddStyle(RunContext* context, const Scene& scene, const SheetOptions& sheet,
              const std::string& picture, std::vector<SheetRow>* rows) {
  RunSettings& settings = context->settings;
  settings.style.picture = picture;
  settings.scene.photo_size = sheet.size;
  const std::string name = fs::path(picture).filename().string();
  context->console->BeginStage(name);
  const ProgressFunction progress = context->console->StageProgress();
  const std::unique_ptr<ViewStylizer> stylizer = MakeSceneStylizer(context, scene.capture);
  std::vector<Image> targets(scene.photos.size());
  std::vector<StyledTrainingView> views;
  std::vector<ColorStatistics> before, after;
  for (const int i : scene.training_views) {
    const size_t n = static_cast<size_t>(i);
    const Image& kept = scene.kept[n];
    const bool masked = kept.num_pixels() > 0;
    if (!stylizer->Knows(i) || (masked && std::find(kept.pixels.begin(), kept.pixels.end(),
                                                    1.0f) == kept.pixels.end()))
      continue;
    Image photo = scene.photos[n];
    if (masked)
      FillMasked(kept,
                 RenderView(scene.stored.field, scene.cameras[n],
                            MarchOptions{scene.stored.field.step})
                     .color,
                 &photo);
    targets[n] = Clipped(stylizer->Stylize(photo, i));
    StyledTrainingView view;
    view.camera = scene.cameras[n];
    view.target = &targets[n];
    if (masked) view.mask = &kept;
    view.name = name + " on " + scene.capture.views[n].file;
    views.push_back(view);
    before.push_back(MeasureColor(scene.photos[n], view.mask));
    after.push_back(MeasureColor(targets[n], view.mask));
  }
  if (views.empty())
    throw Error(ExitCode::kInput, "the 2D method knows none of the photos", picture);
  const MklMap mkl = ComputeMkl(Pool(before), Pool(after));
  const SceneColorMap map{mkl.map, mkl.norm};

  ProgressParts parts(progress, 2);
  const RadianceField& source = scene.stored.field;
  RadianceField paper = source, standard = source, linear = source;
  const Vec3d background = mkl.map(source.background.Cast<double>());
  for (int c = 0; c < 3; ++c)
    standard.background[c] = static_cast<float>(std::clamp(background[c], 0.0, 1.0));
  linear.background = standard.background;
  const TrainNetworkResult by_standard = Train(scene, standard, views, map, "standard",
                                               sheet.steps, settings.run.seed, parts.Next(1));
  const TrainNetworkResult by_paper =
      Train(scene, paper, views, map, "paper", sheet.steps, settings.run.seed, parts.Next(1));
  linear.appearance = ApplyColorMap(source.appearance, by_standard.linear_map);
  standard.appearance = ApplyNetwork(by_standard.network, standard);
  paper.appearance = ApplyNetwork(by_paper.network, paper);
  const std::vector<Image> columns[] = {Shown(scene, linear), Shown(scene, paper),
                                        Shown(scene, standard)};
  const bool of_photos = !stylizer->StylesAnything();
  const std::vector<Image> renders = of_photos ? std::vector<Image>() : Shown(scene, source);
  char words[160];
  std::snprintf(words, sizeof words,
                "%s, %s: K_est %.2f, bounds %.2f (standard, %d steps), %.2f (paper, %d steps)",
                name.c_str(), stylizer->Name().c_str(), by_standard.k_est, by_standard.bound,
                static_cast<int>(by_standard.steps), by_paper.bound,
                static_cast<int>(by_paper.steps));
  for (size_t k = 0; k < scene.shown.size(); ++k) {
    const size_t n = static_cast<size_t>(scene.shown[k]);
    SheetRow row;
    if (k == 0) row.title = words;
    row.cells.push_back({scene.photos[n], scene.capture.views[n].file});
    row.cells.push_back({targets[n], ""});
    const Image wanted =
        of_photos ? targets[n] : Clipped(stylizer->Stylize(renders[k], static_cast<int>(n)));
    for (const std::vector<Image>& column : columns)
      row.cells.push_back(
          {column[k], wanted.empty() ? "" : PsnrCaption(column[k], wanted, of_photos)});
    rows->push_back(std::move(row));
  }
  context->console->EndStage();
}

}  // namespace

void RunContactSheet(const Command& command, const Arguments& arguments, Console* console) {
  SheetOptions sheet;
  RunContext context;
  context.console = console;
  RunSettings& settings = context.settings;
  OptionSet& options = context.options;
  options.Add("Sheet", &sheet);
  options.Add("2D method", &settings.style_2d);
  options.Add("Program", &settings.program);
  constexpr size_t kMostStyles = 64;
  const auto prepared = Prepare(command, arguments,
                                {.least_words = 2,
                                 .most_words = 1 + kMostStyles,
                                 .continues_run = true,
                                 .taken = {"holdout"}},
                                &options);
  if (!prepared) return;
  const Arguments& words = prepared->words;
  const std::string& folder = words[0];
  if (!fs::exists(folder + "/field.npz"))
    throw Error(ExitCode::kInput, "holds no reconstruction", folder,
                "make one with `regrade run` or `regrade reconstruct`");
  if (sheet.out.empty() && !sheet.dry_run)
    throw Error(ExitCode::kUsage, "its value is missing", "--out",
                "name the PNG file to write");
  for (size_t i = 1; i < words.size(); ++i) ReadStylePicture(words[i], nullptr);
  ProbeMethod(&settings.style_2d);

  Workspace workspace(folder);
  context.workspace = &workspace;
  const Backend backend = ChooseBackend(sheet.device, false);  // before work begins
  Scene scene = ReadScene(workspace, sheet);
  scene.backend = backend;
  const std::string plan = std::to_string(words.size() - 1) + " styles, " +
                           std::to_string(scene.shown.size()) + " views each, learned from " +
                           std::to_string(scene.training_views.size()) + " photos at " +
                           std::to_string(sheet.size) + " pixels";
  console->Info(plan);
  if (sheet.dry_run) return;
  std::vector<SheetRow> rows;
  for (size_t i = 1; i < words.size(); ++i) AddStyle(&context, scene, sheet, words[i], &rows);
  const Image picture = MakeContactSheet(kColumns, rows);
  WritePng8(sheet.out, picture);
  console->Info("wrote " + sheet.out + ", " + std::to_string(picture.width) + "x" +
                std::to_string(picture.height));
}

}  // namespace regrade
