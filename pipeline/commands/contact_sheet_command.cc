// regrade contact-sheet: one picture that compares the styles of a folder, or, for style
// pictures, 2D method, linear map and both recipes.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/probe_styles.h"
#include "pipeline/commands/sheet_options.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/contact_sheet.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/fit_pictures.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/network_probe.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/style_targets.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"
#include "stylize/field/blend_fields.h"
#include "stylize/linear_map.h"
#include "stylize/training/restyle_field.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kColumns = {"photo", "2D method", "linear map", "paper recipe",
                                           "standard recipe"};
constexpr char kFieldColumn[] = "field fitted to 2D";

Image Clipped(Image image) {
  for (float& v : image.pixels) v = std::isfinite(v) ? std::clamp(v, 0.0f, 1.0f) : v;
  return image;
}

// The target of a styled frame is what the 2D method makes of the render, or of the photo where
// it can only style photos.
std::string PsnrCaption(const Image& a, const Image& b, bool of_photos) {
  double sum = 0;
  int64_t count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const double d = a.pixels[i] - b.pixels[i];
    if (std::isfinite(d)) sum += d * d, ++count;
  }
  const double mse = sum / static_cast<double>(std::max<int64_t>(1, count));
  return Format("%.1f dB to 2D%s", -10 * std::log10(std::max(mse, 1e-12)),
                of_photos ? " of photo" : "");
}

// Everything about the scene that all styles share.
struct Scene {
  WorkingViews views;
  StoredField stored = {};
  Backend backend = Backend::kCpu;                   // where networks are trained
  std::vector<int> training_views = {}, shown = {};  // views
  std::vector<Camera> cameras = {};                  // of all views
  std::vector<Image> photos = {};                    // of all views
  std::vector<Image> kept = {};              // what --photo-masks leaves of each, or empty
  std::unique_ptr<ObjectMasks> object = {};  // null where the whole scene is styled
  ObjectWeights weights = {};                // of the object
};

Scene ReadScene(const Workspace& workspace, const SheetOptions& sheet,
                const RunSettings& settings) {
  Scene scene{ReadWorkingViews(workspace.Path("poses"), sheet.size, sheet.holdout)};
  scene.stored = ReadFieldFile(workspace.Path("field.npz"));
  // As Restyle does it, for the linear map.
  scene.stored.field.appearance =
      PadShBasis(std::move(scene.stored.field.appearance), kStyledBasis);
  scene.views = scene.views.InField(scene.stored);
  scene.training_views = scene.views.Training();
  if (scene.training_views.empty()) scene.training_views = scene.views.HeldOut();
  const int count = std::min(sheet.views, static_cast<int>(scene.training_views.size()));
  for (int k = 0; k < count; ++k)
    scene.shown.push_back(
        scene.training_views[(2 * static_cast<size_t>(k) + 1) * scene.training_views.size() /
                             (2 * static_cast<size_t>(count))]);
  scene.cameras = scene.views.Cameras();
  for (int i = 0; i < scene.views.count(); ++i) {
    scene.photos.push_back(scene.views.Photo(i));
    scene.kept.push_back(scene.views.Mask(i));
  }
  scene.object = OpenObjectMasks(settings, scene.views);
  if (scene.object != nullptr)
    scene.weights = VoteForObject(settings, scene.views, scene.training_views, *scene.object,
                                  scene.stored.field, nullptr);
  return scene;
}

// Renders of the shown views, clipped as pictures are.
std::vector<Image> Shown(const Scene& scene, const RadianceField& field) {
  const FieldRenderer renderer(field, Backend::kCpu);
  std::vector<Image> frames;
  for (const int i : scene.shown)
    frames.push_back(Clipped(renderer.Render(scene.cameras[i]).color));
  return frames;
}

// The pictures that the 2D method makes of the photos.
struct StyledPhotos {
  StyleTargets targets;
  std::vector<Image> pictures;  // [views]; empty where a view is not trained on
};

StyledPhotos StylePhotos(const Scene& scene, ViewStylizer* stylizer, const std::string& name) {
  const RadianceField& field = scene.stored.field;
  StyledPhotos styled{{field, scene.object.get(), &scene.weights}, {}};
  styled.pictures.resize(scene.photos.size());
  std::optional<FieldRenderer> renderer;  // where a photo has a mask
  for (const int i : scene.training_views) {
    const size_t n = static_cast<size_t>(i);
    if (!stylizer->Knows(i) || (scene.object != nullptr && !scene.object->Knows(i))) continue;
    const auto target = [&] {
      Image photo = scene.photos[n];
      if (!scene.kept[n].empty()) {
        if (!renderer) renderer.emplace(field, Backend::kCpu);
        FillMasked(scene.kept[n], renderer->Render(scene.cameras[n]).color, &photo);
      }
      Image picture = stylizer->Stylize(photo, i);
      if (!stylizer->StylesAnything()) picture = scene.views.AsSeen(i, std::move(picture));
      return styled.pictures[n] = Clipped(std::move(picture));
    };
    styled.targets.Add({i, scene.cameras[n],
                        name + " on " + scene.views.capture().views[n].file, scene.kept[n],
                        [&] { return scene.photos[n]; }, target});
  }
  return styled;
}

RestyledField RestyleByRecipe(const Scene& scene, const TrainingTargets& targets,
                              const std::string& recipe, int steps, uint64_t seed,
                              const ProgressFunction& progress) {
  RestyleRequest request;
  ApplyStyleRecipe(recipe, &request.options);
  request.options.seed = seed;
  if (steps > 0) request.options.steps = steps;
  request.backend = scene.backend;
  if (scene.object != nullptr) request.object_weights = &scene.weights.all;
  RestyleHooks hooks;
  hooks.training.progress = progress;
  return Restyle(scene.stored.field, targets, request, hooks);
}

// The standard recipe's field with its linear map in place of the network.
RadianceField MapColors(const Scene& scene, const RestyledField& standard) {
  RadianceField mapped = scene.stored.field;
  mapped.appearance = ApplyColorMap(mapped.appearance, standard.trained.linear_map);
  if (scene.object != nullptr)
    return MixFields(scene.stored.field, {&mapped}, {1}, &scene.weights.all);
  mapped.background = standard.styled.background;
  return mapped;
}

// Fitted to the pictures of the photos with the options of the scene's own fit.
RadianceField FieldOfPictures(const Scene& scene, const std::vector<Image>& pictures,
                              const Vec3f& background, const std::string& folder,
                              const ProgressFunction& progress) {
  RunSettings of_run;
  OptionSet options;
  of_run.Bind(&options);
  ResolveSettings({.run_json = folder + "/run.json"}, &options);
  std::vector<int> indices;
  for (const int i : scene.training_views)
    if (!pictures[static_cast<size_t>(i)].empty()) indices.push_back(i);
  const auto picture = [&](int i) {
    Image image = pictures[static_cast<size_t>(i)];
    scene.views.LeaveOutMasked(i, &image);
    return image;
  };
  return FitPictures(scene.views, scene.stored, indices, picture, of_run, background,
                     scene.backend, progress)
      .stored.field;
}

// What the 2D method makes of renders of the shown views; empty where it can only style photos.
std::vector<Image> StyleRenders(RunContext* context, const Scene& scene,
                                ViewStylizer* of_photos) {
  if (!of_photos->StylesAnything()) return {};
  std::unique_ptr<ViewStylizer> of_renders;
  std::optional<CoverageRenderer> object;
  std::vector<Image> coverage;
  if (scene.object != nullptr) {
    object.emplace(scene.stored.field, scene.weights);
    of_renders = MakeSceneStylizer(context, scene.views, scene.object.get(),
                                   [&](const Image&, int) { return coverage; });
  }
  std::vector<Image> styled = Shown(scene, scene.stored.field);
  for (size_t k = 0; k < styled.size(); ++k) {
    const int view = scene.shown[k];
    if (object) coverage = object->Render(scene.cameras[view]);
    ViewStylizer* const stylizer = of_renders ? of_renders.get() : of_photos;
    styled[k] = Clipped(stylizer->Stylize(styled[k], view));
  }
  return styled;
}

void AddStyle(RunContext* context, const Scene& scene, const SheetOptions& sheet,
              const std::vector<std::string>& pictures, std::vector<SheetRow>* rows) {
  RunSettings& settings = context->settings;
  settings.style.pictures = pictures;
  Arguments files;
  for (const std::string& picture : pictures)
    files.push_back(fs::path(picture).filename().string());
  const std::string name = Join(files, " and ");
  context->console->BeginStage(name);
  const ProgressFunction progress = context->console->StageProgress();
  const std::unique_ptr<ViewStylizer> stylizer =
      MakeSceneStylizer(context, scene.views, scene.object.get());
  const StyledPhotos styled = StylePhotos(scene, stylizer.get(), name);
  const TrainingTargets& targets = styled.targets.targets();
  if (targets.empty())
    throw InputError(scene.object != nullptr
                         ? "the masks and the 2D method agree on no part of the photos"
                         : "the 2D method has a picture of none of the photos",
                     name);

  ProgressParts parts(progress, sheet.control_field ? 3 : 2);
  const uint64_t seed = settings.run.seed;
  const RestyledField standard =
      RestyleByRecipe(scene, targets, "standard", sheet.steps, seed, parts.Next(1));
  const RestyledField paper =
      RestyleByRecipe(scene, targets, "paper", sheet.steps, seed, parts.Next(1));
  std::vector<std::vector<Image>> columns = {Shown(scene, MapColors(scene, standard)),
                                             Shown(scene, paper.styled),
                                             Shown(scene, standard.styled)};
  if (sheet.control_field)
    columns.push_back(
        Shown(scene, FieldOfPictures(scene, styled.pictures, standard.styled.background,
                                     context->workspace->folder(), parts.Next(1))));
  const std::vector<Image> renders_2d = StyleRenders(context, scene, stylizer.get());
  const bool of_photos = renders_2d.empty();
  const std::string title =
      Format("%s, %s: K_est %.2f, bounds %.2f (standard, %d steps), %.2f (paper, %d steps)",
             name.c_str(), stylizer->Name().c_str(), standard.trained.k_est,
             standard.trained.bound, static_cast<int>(standard.trained.steps),
             paper.trained.bound, static_cast<int>(paper.trained.steps));
  for (size_t k = 0; k < scene.shown.size(); ++k) {
    const size_t n = static_cast<size_t>(scene.shown[k]);
    SheetRow row;
    if (k == 0) row.title = title;
    row.cells.push_back({scene.photos[n], scene.views.capture().views[n].file});
    row.cells.push_back({styled.pictures[n], ""});
    const Image& reference = of_photos ? styled.pictures[n] : renders_2d[k];
    for (const std::vector<Image>& column : columns)
      row.cells.push_back(
          {column[k], reference.empty() ? "" : PsnrCaption(column[k], reference, of_photos)});
    rows->push_back(std::move(row));
  }
  context->console->EndStage();
}

// A row for each shown view: the photo, and each style as it is in the folder.
std::vector<SheetRow> RowsOfStyles(const Scene& scene, const std::string& folder,
                                   const Arguments& names) {
  std::vector<SheetRow> rows(scene.shown.size());
  for (size_t k = 0; k < rows.size(); ++k) {
    const int i = scene.shown[k];
    rows[k].cells.push_back({scene.photos[static_cast<size_t>(i)], scene.views.View(i).file});
  }
  for (const std::string& name : names) {
    const std::vector<Image> renders =
        Shown(scene, ReadStyledField(folder, StyleFolder(folder, name)).field);
    for (size_t k = 0; k < rows.size(); ++k) rows[k].cells.push_back({renders[k], name});
  }
  return rows;
}

// The styles of the folder that `words` behind it name, all that were learned without any;
// empty for pictures.
Arguments StylesAmong(const Arguments& words, Console* console) {
  const std::string& folder = words[0];
  if (words.size() == 1) {
    Arguments left;
    const Arguments learned = LearnedStyles(folder, &left);
    if (learned.empty()) ChosenLearnedStyle(folder, left.empty() ? "" : left[0]);  // refuses
    if (!left.empty()) console->Info(LeftOutText(folder, left));
    return learned;
  }
  const Arguments known = StyleNames(folder);
  Arguments styles;
  for (size_t i = 1; i < words.size(); ++i)
    if (std::ranges::find(known, words[i]) != known.end())
      styles.push_back(ChosenLearnedStyle(folder, words[i]));
  if (!styles.empty() && styles.size() + 1 != words.size())
    throw UsageError("names of styles and pictures are mixed", "regrade contact-sheet",
                     "name styles of the folder (" + Join(known, ", ") + "), or pictures");
  return styles;
}

}  // namespace

void RunContactSheet(const Command& command, const Arguments& arguments, Console* console) {
  SheetOptions sheet;
  RunContext context;
  context.console = console;
  RunSettings& settings = context.settings;
  OptionSet& options = context.options;
  options.Add("Sheet", &sheet);
  options.Add("Style", &settings.style.match);
  options.Add("2D method", &settings.style_2d);
  options.Add("Object", &settings.object);
  options.Add("Program", &settings.program);
  constexpr size_t kMostStyles = 64;
  const auto prepared = Prepare(command, arguments,
                                {.least_words = 1,
                                 .most_words = 1 + kMostStyles,
                                 .continues_run = true,
                                 .taken = {"holdout", "masks", "mask-vote", "mask-edge"}},
                                &options);
  if (!prepared) return;
  const Arguments& words = prepared->words;
  const std::string& folder = words[0];
  const Arguments styles =
      fs::exists(folder + "/field.npz") ? StylesAmong(words, console) : Arguments();
  if (!fs::exists(folder + "/field.npz"))
    throw InputError("holds no reconstruction", folder,
                     "make one with `regrade run` or `regrade reconstruct`");
  if (!sheet.dry_run) RequireValue(sheet.out, "--out", "name the PNG file to write");
  if (styles.empty()) {
    for (size_t i = 1; i < words.size(); ++i) CheckStyle(words[i], settings);
    settings.style.pictures.assign(words.begin() + 1, words.end());
    CheckMatch(settings);
    if (const std::string& network = settings.style.match.network; !network.empty())
      ProbeFeatureNetwork(network);
  }
  ProbeMethod(&settings.style_2d,
              sheet.dry_run ? NetworkAccess() : AccessAfterYes(sheet.yes, console));
  ProbeMasks(&settings.object);

  Workspace workspace(folder);
  CheckResults(folder, styles);
  context.workspace = context.style = &workspace;
  settings.scene.photo_size = sheet.size;
  const Backend backend = ChooseBackend(sheet.device, false);  // before work begins
  Scene scene = ReadScene(workspace, sheet, settings);
  scene.backend = backend;
  const std::string plan =
      styles.empty()
          ? Concat(Counted(std::ssize(words) - 1, "style"), ", ",
                   Counted(std::ssize(scene.shown), "view"), " each, trained on ",
                   Counted(std::ssize(scene.training_views), "photo"), " at ", sheet.size,
                   " pixels")
          : Concat(Counted(std::ssize(scene.shown), "view"), " of ", Join(styles, ", "));
  console->Info(plan);
  if (sheet.dry_run) return;
  std::vector<SheetRow> rows;
  Arguments columns = kColumns;
  if (sheet.control_field) columns.push_back(kFieldColumn);
  if (!styles.empty()) {
    columns = {"photo"};
    columns.insert(columns.end(), styles.begin(), styles.end());
    rows = RowsOfStyles(scene, folder, styles);
  } else {
    const Arguments pictures(words.begin() + 1, words.end());
    if (settings.style.match.On())
      AddStyle(&context, scene, sheet, pictures, &rows);
    else
      for (const std::string& picture : pictures)
        AddStyle(&context, scene, sheet, {picture}, &rows);
  }
  const Image picture = MakeContactSheet(columns, rows);
  WritePng8(sheet.out, picture);
  console->Info(Concat("wrote ", sheet.out, ", ", picture.width, "x", picture.height));
}

}  // namespace regrade
