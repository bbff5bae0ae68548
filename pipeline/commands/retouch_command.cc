// regrade retouch: one photo was retouched, and the scene follows, as a style of its own.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/commands/command.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/photo_edit.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// In the style's folder: what was found in the edit.
constexpr char kRecord[] = "retouch.json";

struct RetouchOptions {
  std::string photo, edited;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("photo", photo, {.help = "the photo that was retouched, by its name in the capture"});
    bind("edited", edited,
         {.help = "the retouched picture: the whole frame, in any size of the same shape"});
  }
};

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

JsonValue RecordOf(const RetouchOptions& options, const PhotoEdit& edit,
                   const std::vector<std::string>& notices) {
  JsonValue::Array said;
  for (const std::string& notice : notices) said.push_back(notice);
  return JsonValue::Object{{"photo", options.photo},
                           {"edited", options.edited},
                           {"change", edit.change},
                           {"local", edit.local},
                           {"vignette", edit.vignette},
                           {"sharpening", edit.sharpening},
                           {"grain", edit.grain},
                           {"steepest_slope", SteepestSlope(edit.table)},
                           {"notices", said}};
}

// Writes what the style is made from to its folder, and sets style picture and method: a LUT
// for an edit that is one map of colours, else the cleaned picture of this one photo.
void WriteEdit(const std::string& folder, const PhotoEdit& edit, const CaptureView& view,
               RunSettings* settings) {
  fs::create_directories(folder);
  settings->style.pictures = {AbsolutePath(folder + "/edit.cube")};
  WriteFileAtomically(folder + "/edit.cube", CubeText(edit.table, "edit"));
  settings->style_2d.method = StyleOptions().method;
  if (!edit.IsLocal()) return;
  const std::string pictures = folder + "/retouched";
  fs::remove_all(pictures);
  fs::create_directories(pictures);
  const std::string picture = pictures + "/" + Stem(view.file) + ".png";
  WritePng16(picture, edit.picture);
  settings->style.pictures = {AbsolutePath(picture)};
  settings->style_2d.method = "folder:" + AbsolutePath(pictures);
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
  RequireValue(retouch.edited, "--edited", "name the retouched picture");
  context.settings = given.settings;
  RunSettings& settings = context.settings;
  settings.Bind(&context.options);
  if (settings.object.On() || settings.style_2d.scene_wide)
    throw UsageError("the edit says itself what it changes", "--masks and --scene-wide",
                     "leave them out");
  const std::string wanted = given.options.Given("name").value_or("");
  const std::string name = wanted.empty() ? SafeStyleName(retouch.edited) : wanted;
  if (SafeStyleName(name + ".x") != name)
    throw UsageError("'" + name + "' is not allowed", "--name",
                     "use letters, digits, '-', '_' and '.', not first");
  const std::string style = StyleFolder(folder, name);
  if (fs::exists(style + "/run.json") && !fs::exists(style + "/" + kRecord))
    throw UsageError("style '" + name + "' belongs to another picture", "--name",
                     "choose another name");
  if (!prepared->run_words.empty()) context.source = prepared->run_words[0];
  settings.run.out = AbsolutePath(folder);
  CheckTogether(settings);

  Workspace workspace(folder, settings.start.break_lock);
  context.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  const WorkingViews views = context.Views();
  const int view = ViewOf(views, retouch.photo);
  DecodeLimits limits;
  limits.min_side = 1;
  const Image photo = views.Photo(view);
  const PhotoEdit edit =
      AnalyseEdit(photo, EditAtPhotoSize(Colors(DecodePhoto(retouch.edited, limits).image),
                                         photo, retouch.edited));
  const std::vector<std::string> notices = EditNotices(edit);
  for (const std::string& notice : notices) console->Info(notice);
  if (settings.start.dry_run) return;
  WriteEdit(style, edit, views.View(view), &settings);
  WriteJsonFile(style + "/" + kRecord, RecordOf(retouch, edit, notices));
  RunStyles("style_2d", {{name, settings.style.picture()}}, &context);
}

}  // namespace regrade
