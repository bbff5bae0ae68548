// regrade retouch: one photo was retouched, and the scene follows, as a style of its own.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/commands/command.h"
#include "pipeline/dry_run.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/still_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/photo_edit.h"
#include "pipeline/stages/style_residual.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// In the output folder: renders to be edited.
constexpr char kRenders[] = "retouch";
// Of --vignette.
constexpr char kVignetteOfEdit[] = "edit";

struct RetouchOptions {
  std::string photo, edited;
  std::string from = "photo";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("photo", photo, {.help = "the photo that was retouched, by its name in the capture"});
    bind("edited", edited,
         {.help = "the retouched picture: the whole frame, in any size of the same shape"});
    bind("from", from,
         {.help = "what was edited: the photo, or the scene's render from its place, which is "
                  "written to retouch/ of DIR, as a TIFF of 16 bits, where --edited is missing",
          .choices = "photo|render"});
  }
};

DecodeLimits AnySize() {
  DecodeLimits limits;
  limits.min_side = 1;
  return limits;
}

std::string Stem(const std::string& file) { return fs::path(file).stem().string(); }

// The view that `name` means: its file's name, with or without folder and extension.
int ViewOf(const WorkingViews& views, const std::string& name) {
  int found = -1, count = 0;
  for (int i = 0; i < views.count(); ++i) {
    const std::string& file = views.View(i).file;
    if (file == name || fs::path(file).filename() == fs::path(name).filename()) return i;
    if (Stem(file) == Stem(name)) found = i, ++count;
  }
  if (count == 1) return found;
  std::vector<std::string> some;
  for (int i = 0; i < std::min(views.count(), 5); ++i) some.push_back(views.View(i).file);
  throw InputError(
      count == 0 ? "is no photo of the capture" : "is more than one photo", name,
      "name one of them: " + Join(some, ", ") + (views.count() > 5 ? ", ..." : ""));
}

JsonValue RecordOf(const RetouchOptions& options, const PhotoEdit& edit, bool keeps_vignette,
                   const std::vector<std::string>& notices) {
  JsonValue::Array said;
  for (const std::string& notice : notices) said.push_back(notice);
  return JsonValue::Object{{"photo", options.photo},
                           {"edited", options.edited},
                           {"from", options.from},
                           {"change", edit.change},
                           {"local", edit.local},
                           {"of_photo", edit.of_photo},
                           {"vignette", edit.vignette(1)},
                           {"keep_vignette", keeps_vignette},
                           {"sharpening", edit.sharpening},
                           {"grain", edit.grain},
                           {"steepest_slope", SteepestSlope(edit.table)},
                           {"notices", said}};
}

// What a person edits in place of the photo: the unstyled scene, in the photo's own size.
void WriteRender(const std::string& path, int view, RunContext* context) {
  const RunSettings& settings = context->settings;
  const std::string field = context->workspace->Path("field.npz");
  if (!fs::exists(field))
    throw InputError("holds no reconstruction", settings.run.out,
                     "make one with `regrade run` or `regrade reconstruct`");
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  constexpr int kLongest = 1 << 16;
  StoredField geometry = ReadFieldGeometry(field);
  const Camera camera = ReadWorkingViews(context->workspace->Path("poses"), kLongest, 0)
                            .InField(geometry)
                            .CameraOf(view);
  const StoredField stored = SeenPart(std::move(geometry), field, {camera});
  WriteStill(path, FieldRenderer(stored.field, backend).Render(camera).color);
  context->console->Info("wrote " + path + ": edit it, and give the edit with --edited");
}

// The picture that was edited: the photo, or the render that an earlier call wrote.
Image BeforeEdit(const RetouchOptions& options, const std::string& render, const Image& photo) {
  if (options.from == "photo") return photo;
  if (!fs::exists(render))
    throw InputError("the render was not written yet", render,
                     "leave --edited out once: --from render writes what is to be edited");
  return Resize(Colors(DecodePhoto(render, AnySize()).image), photo.width, photo.height);
}

// Sets style picture and residual: the edit's map of colours as a LUT, and what one photo has
// beyond it as a layer, in the style's folder.
void UseEdit(const std::string& folder, const PhotoEdit& edit, RunSettings* settings) {
  settings->style.pictures = {AbsolutePath(folder + "/" + kEditLut)};
  settings->style.match = {};
  settings->style_2d.method = StyleOptions().method;
  settings->residual.residual = "views";
  if (!edit.IsLocal()) return;
  // The network that keeps all colours is where training begins, and nothing is to be learned.
  if (edit.of_photo) {
    settings->network.steps = 1;
    settings->network.rate_first = settings->network.rate_last = 0;
  }
  settings->residual.residual = "layers:" + AbsolutePath(folder + "/layers");
}

// Writes what UseEdit names.
void WriteEdit(const std::string& folder, const PhotoEdit& edit, const CaptureView& view) {
  fs::create_directories(folder);
  WriteFileAtomically(folder + "/" + kEditLut, CubeText(edit.table, "edit"));
  const std::string layers = folder + "/layers", pictures = folder + "/" + kRetouchedFolder;
  for (const std::string& made : {layers, pictures}) {
    fs::remove_all(made);
    if (edit.IsLocal()) fs::create_directories(made);
  }
  if (!edit.IsLocal()) return;
  WritePng16(pictures + "/" + Stem(view.file) + ".png", edit.picture);
  WriteLayer(layers + "/" + Stem(view.file) + ".png", edit.layer);
}

}  // namespace

void RunRetouch(const Command& command, const Arguments& arguments, Console* console) {
  RetouchOptions retouch;
  RunContext context, given;  // run.json of the style knows the options of a run alone
  context.console = console;
  given.options.Add("Retouch", &retouch);
  given.settings.Bind(&given.options);
  const auto prepared = Prepare(command, arguments, {.continues_run = true}, &given.options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  RequireValue(retouch.photo, "--photo", "name the photo that was retouched");
  const bool writes_render = retouch.from == "render" && retouch.edited.empty();
  if (!writes_render) RequireValue(retouch.edited, "--edited", "name the retouched picture");
  context.settings = given.settings;
  RunSettings& settings = context.settings;
  settings.Bind(&context.options);
  if (settings.object.On() || settings.style_2d.scene_wide)
    throw UsageError("the edit says itself what it changes", "--masks and --scene-wide",
                     "leave them out");
  const std::string wanted = given.options.Given("name").value_or("");
  const std::string name =
      wanted.empty() ? SafeStyleName(writes_render ? retouch.photo : retouch.edited) : wanted;
  if (SafeStyleName(name + ".x") != name)
    throw UsageError("'" + name + "' is not allowed", "--name",
                     "use letters, digits, '-', '_' and '.', not first");
  const std::string style = StyleFolder(folder, name);
  if (fs::exists(style + "/run.json") && !fs::exists(style + "/" + kRetouchRecord))
    throw UsageError("style '" + name + "' belongs to another picture", "--name",
                     "choose another name");
  if (!prepared->run_words.empty()) context.source = prepared->run_words[0];
  settings.run.out = AbsolutePath(folder);
  // Not the vignette of the run's own style.
  std::string& vignette = settings.render.vignette;
  vignette = given.options.Given("vignette").value_or("none");
  const bool keeps_vignette = vignette == kVignetteOfEdit;
  if (keeps_vignette) vignette = "none";
  CheckTogether(settings);

  Workspace workspace(folder);
  context.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  CheckResults(folder, {});
  Workspace::RefuseLinks(style);
  const WorkingViews views = context.Views();
  const int view = ViewOf(views, retouch.photo);
  const std::string render = std::string(kRenders) + "/" + Stem(views.View(view).file) + ".tif";
  if (writes_render && settings.start.dry_run)
    return console->Info("would write " + workspace.Path(render));
  if (writes_render) return WriteRender(workspace.NewPath(render), view, &context);
  // A photo is edited as it was taken; a render is what the scene's cameras see.
  const bool as_taken = retouch.from == "photo";
  const WorkingViews own = as_taken ? views.Lenses() : views;
  Image photo = BeforeEdit(retouch, workspace.Path(render), own.Photo(view));
  Image edited = EditAtPhotoSize(Colors(DecodePhoto(retouch.edited, AnySize()).image), photo,
                                 retouch.edited);
  if (as_taken) {
    photo = views.AsSeen(view, std::move(photo));
    edited = views.AsSeen(view, std::move(edited));
  }
  const PhotoEdit edit = AnalyseEdit(photo, edited);
  const std::vector<std::string> notices = EditNotices(edit, keeps_vignette);
  for (const std::string& notice : notices) console->Info(notice);
  if (keeps_vignette) vignette = VignetteText(edit.vignette);
  UseEdit(style, edit, &settings);
  if (settings.start.dry_run) {
    PlanStyles("style_2d", {{name, settings.style.pictures}}, &context);
    return SayPlan(context);
  }
  WriteEdit(style, edit, views.View(view));
  if (!edit.IsLocal())
    console->Info("the map of colours is " + style + "/" + kEditLut +
                  ", a LUT for other programs");
  WriteJsonFile(style + "/" + kRetouchRecord, RecordOf(retouch, edit, keeps_vignette, notices));
  RunStyles("style_2d", {{name, settings.style.pictures}}, &context);
}

}  // namespace regrade
