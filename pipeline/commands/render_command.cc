// regrade render: the frames and films of a style again, single stills, or the film of a page.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/continue_command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/text.h"
#include "pipeline/images/still_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/film_parts.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/stages/mixed_film.h"
#include "pipeline/stages/photo_vignette.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

struct StillOptions {
  std::vector<std::string> photos;
  int size = 0;
  std::string format = "png";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("photo", photos,
         {.help = "name of a photo: renders the styled scene from its place to stills/ in the "
                  "style's folder, and nothing else; may be given more than once"});
    bind("size", size,
         {.unit = "pixels",
          .help = "longer side of stills, at most the photo's own; 0 takes that",
          .min = 0,
          .max = 65536});
    bind("format", format,
         {.help = "of stills; tiff has 16 bits, and all are tagged as sRGB",
          .choices = "png|jpeg|tiff"});
  }
};

struct PathFilmOptions {
  std::string path;
  int film_size = 1280;
  double fps = 30;
  std::string device = "auto";
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("path", path,
         {.help = "a page's camera_path.json: writes its film, rendered exactly, to films/ of "
                  "the folder, and nothing else"});
    bind("film-size", film_size,
         {.unit = "pixels",
          .help = "longer side of the film; its shape is that of the first keyframe",
          .min = 16,
          .max = 8192});
    bind("fps", fps,
         {.unit = "frames/s",
          .help = "frame rate of the film, where the path does not say one",
          .min = 1,
          .max = 240});
    bind("device", device,
         {.help = "the processor that renders frames", .choices = "auto|cpu|cuda"});
    bind("dry-run", dry_run, {.help = "prints what would be done, and does nothing"});
  }
};

// The photo of a name, with or without its ending. Throws Error(kInput) with the nearest ones.
int PhotoNamed(const Capture& capture, const std::string& name) {
  std::string known;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    const std::filesystem::path file = capture.views[i].file;
    if (file == name || file.filename() == name || file.stem() == name)
      return static_cast<int>(i);
    if (i < 5) known += (i > 0 ? ", " : "") + file.string();
  }
  throw InputError("no photo of this name was placed", name,
                   "its photos are " + known + " ...");
}

void RenderStills(const std::string& folder, const std::string& name,
                  const StillOptions& options, const RunSettings& settings, Console* console) {
  Workspace scene(folder), style(StyleFolder(folder, name));
  CheckResults(folder, {name});
  constexpr int kLongest = 1 << 16;
  const std::string field = scene.Path("field.npz");
  StoredField geometry = ReadFieldGeometry(field);
  const WorkingViews views =
      ReadWorkingViews(scene.Path("poses"), options.size > 0 ? options.size : kLongest, 0)
          .InField(geometry);
  const Vignette vignette = ParseVignette(settings.render.vignette);
  std::vector<int> wanted;
  std::vector<Camera> cameras;
  for (const std::string& still : options.photos) {
    wanted.push_back(PhotoNamed(views.capture(), still));
    cameras.push_back(views.CameraOf(wanted.back()));
  }
  StoredField stored = StyledFieldOf(SeenPart(std::move(geometry), field, cameras),
                                     style.folder(), settings.style.strength);
  const FieldRenderer renderer(std::move(stored.field),
                               ChooseBackend(settings.run.device, settings.run.reproducible));
  for (const int i : wanted) {
    Image picture = renderer.Render(views.CameraOf(i)).color;
    PutVignette(vignette, &picture);
    const std::string ending = options.format == "jpeg"   ? ".jpg"
                               : options.format == "tiff" ? ".tif"
                                                          : ".png";
    const std::string path = style.NewPath(
        "stills/" + std::filesystem::path(views.View(i).file).stem().string() + ending);
    WriteStill(path, picture);
    console->Info(Concat("wrote ", path, ", ", picture.width, "x", picture.height));
  }
}

// --path FILE.json is a page's path; other values are names of paths.
bool NamesPathFile(const Arguments& arguments) {
  for (size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const bool apart = arguments[i] == "--path" && i + 1 < arguments.size();
    if ((apart && arguments[i + 1].ends_with(".json")) ||
        (arguments[i].starts_with("--path=") && arguments[i].ends_with(".json")))
      return true;
  }
  return false;
}

void RenderPath(const Command& command, const Arguments& arguments, Console* console) {
  PathFilmOptions settings;
  ProgramOptions program;
  OptionSet options;
  options.Add("Film", &settings);
  options.Add("Program", &program);
  const auto prepared = Prepare(
      command, arguments, {.continues_run = true, .taken = {"film-size", "fps"}}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  const KeyframePath path = ReadKeyframePath(settings.path);
  const double fps = path.fps > 0 && !options.Given("fps") ? path.fps : settings.fps;
  const PathFilm film = PlanPathFilm(folder, path, settings.film_size, fps);
  const std::string name =
      std::string(kFilmsFolder) + "/" + SafeStyleName(settings.path) + ".mp4";
  const std::string what = Concat(Counted(film.frames, "frame"), " of ", film.width, "x",
                                  film.height, " to ", folder, "/", name);
  if (settings.dry_run) return console->Info("would render " + what);
  const Backend backend = ChooseBackend(settings.device, false);
  const Workspace scene(folder);
  console->BeginStage("film");
  WritePathFilm(folder, path, film, backend, scene.NewPath(name), console->StageProgress());
  console->EndStage();
  console->Info("rendered " + what);
}

}  // namespace

void RunRender(const Command& command, const Arguments& arguments, Console* console) {
  if (NamesPathFile(arguments)) return RenderPath(command, arguments, console);
  const bool stills = std::ranges::any_of(arguments, [](const std::string& word) {
    return word == "--photo" || word.starts_with("--photo=");
  });
  if (!stills && !AsksForHelp(arguments))
    return ContinueStyle(command, arguments, "render", console);
  StillOptions still;
  FilmParts parts;  // in the help
  RunSettings settings;
  OptionSet options;
  options.Add("Still", &still);
  options.Add("Parts", &parts);
  settings.Bind(&options);
  const auto prepared = Prepare(command, arguments, {.continues_style = true}, &options);
  if (!prepared) return;
  RefuseRequirements(options);
  if (!parts.part.empty()) throw UsageError("goes without --part", "--photo");
  const std::string& folder = prepared->words[0];
  const std::string name = ChosenLearnedStyle(folder, options.Given("name").value_or(""));
  if (settings.start.dry_run) {
    console->Info(Concat(Counted(std::ssize(still.photos), "still"), " of style ", name,
                         " would be written to ", StyleFolder(folder, name), "/stills"));
    return;
  }
  RenderStills(folder, name, still, settings, console);
}

}  // namespace regrade
