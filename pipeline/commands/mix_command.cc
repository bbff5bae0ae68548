// regrade mix: a film that blends from the unstyled scene into its style, or from one style
// into another, and the field of a constant blend.
#include <algorithm>
#include <filesystem>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/mix_keys.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/mixed_film.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"
#include "stylize/field/blend_fields.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct MixOptions {
  std::string out;
  std::string mix;
  bool object = false;
  std::string device = "auto";
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the folder to write: a new one, or that of an earlier mix"});
    bind(
        "mix", mix,
        {.help =
             "weight of the style over time, 0 for the unstyled scene and 1 for the style: 0:1 "
             "blends from one to the other, 0:1:0 and back; 0.5 is constant, and also writes "
             "mixed.npz. With several styles one weight for each: 1,0:0,1 blends the first "
             "into the second. By default through all styles in order"});
    bind("object", object,
         {.help = "blends only the object whose masks DIR was styled with; styles of the whole "
                  "scene are possible, too"});
    bind("device", device,
         {.help = "the processor that renders frames", .choices = "auto|cpu|cuda"});
    bind("dry-run", dry_run, {.help = "prints what would be done, and does nothing"});
  }
};

bool IsFieldFile(const std::string& word) { return word.ends_with(".npz"); }

// A style of the folder by its name, or a field's file. Throws Error(kInput).
StoredField ReadStyle(const std::string& folder, const std::string& word) {
  return IsFieldFile(word) ? ReadFieldFile(word)
                           : ReadStyledField(folder, StyleFolder(folder, word));
}

void MakeMixFolder(const fs::path& out) {
  std::error_code error;
  if (fs::exists(out, error) && !fs::is_empty(out, error) && !fs::exists(out / "mix.json"))
    throw UsageError("is not empty", out.string(), "name a new folder with --out");
  fs::remove_all(out / "frames", error);
  for (const char* file : {"mixed.mp4", "mixed.npz"}) fs::remove(out / file, error);
  fs::create_directories(out / "frames", error);
  if (error) throw ResourceError(error.message(), out.string());
}

// On the path "views" frames have the sizes of their photos; a film has one size.
struct MixCameras {
  std::vector<Camera> frames, film;
};

MixCameras CamerasOf(const std::string& folder, const StoredField& stored,
                     const RenderOptions& render) {
  const JsonValue run = ReadRunFile(folder + "/run.json").options;
  const WorkingViews views =
      ReadWorkingViews(folder + "/poses", static_cast<int>(run.At("photo-size").AsInt()), 0)
          .InField(stored);
  const std::vector<Camera> film = MakeFilmPath(views, render, &stored.field).film;
  return {render.path.path == "views" ? views.Cameras() : film, film};
}

void WriteMix(const std::string& out, const RadianceField& source,
              const std::vector<StoredField>& styles, const MixKeys& keys,
              const std::vector<float>* object_weights, const MixCameras& cameras, double fps,
              Backend backend, Console* console) {
  std::optional<VideoWriter> film;
  try {
    film.emplace(out + "/mixed.mp4", cameras.film[0].width, cameras.film[0].height, fps);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    console->Warn("no film: " + error.what_failed());
  }
  console->BeginStage("mix");
  const ProgressFunction progress = console->StageProgress();
  MixRenderer mixed(source, styles, object_weights, backend);
  const int frames = static_cast<int>(cameras.film.size());
  for (int i = 0; i < frames; ++i) {
    ReportOrThrow(progress, i, frames);
    const FieldRenderer& renderer =
        mixed.With(keys.At(static_cast<double>(i) / std::max(1, frames - 1)));
    const Camera& of_frame = cameras.frames[i];
    const Camera& of_film = cameras.film[i];
    const Image frame = renderer.Render(of_frame).color;
    WritePng8(out + "/frames/" + FrameName(i), frame);
    if (film)
      film->Add(of_frame.SameIntrinsics(of_film) ? frame : renderer.Render(of_film).color);
  }
  if (film) film->Finish();
  console->EndStage();
}

}  // namespace

void RunMix(const Command& command, const Arguments& arguments, Console* console) {
  MixOptions settings;
  RenderOptions render;
  ProgramOptions program;
  OptionSet options;
  options.Add("Mix", &settings);
  options.Add("Render", &render);
  options.Add("Program", &program);
  constexpr size_t kMostWords = 17;  // the folder and 16 styles
  const auto prepared = Prepare(command, arguments,
                                {.most_words = kMostWords,
                                 .continues_run = true,
                                 .taken = {"fps", "path", "film-seconds", "film-size"}},
                                &options);
  if (!prepared) return;
  const Arguments& words = prepared->words;
  const std::string& folder = words[0];
  Arguments chosen;  // names of styles, or files
  for (size_t i = 1; i < words.size(); ++i)
    chosen.push_back(IsFieldFile(words[i]) ? words[i] : ChosenLearnedStyle(folder, words[i]));
  if (chosen.empty()) chosen.push_back(ChosenLearnedStyle(folder, ""));
  const MixKeys keys = ParseMixKeys(settings.mix, static_cast<int>(chosen.size()));
  if (!settings.dry_run) RequireValue(settings.out, "--out", "name the folder to write");
  ChooseBackend(settings.device, false);
  for (const std::string& style : chosen)
    if (IsFieldFile(style) && !fs::is_regular_file(style))
      throw InputError("there is no such style", style, "make it with `regrade stylize`");

  Arguments own = chosen;
  std::erase_if(own, IsFieldFile);
  CheckResults(folder, own);
  StoredField stored = ReadFieldFile(folder + "/field.npz");
  const Backend backend = ChooseBackend(settings.device, false);
  const MixCameras cameras = CamerasOf(folder, stored, render);
  if (settings.dry_run) {
    console->Info(Concat(Counted(std::ssize(cameras.film), "frame"), " of ",
                         cameras.film[0].width, "x", cameras.film[0].height, " along ",
                         render.path.path, ", ", Counted(std::ssize(keys.points), "point"),
                         " of ", Counted(std::ssize(chosen), "style")));
    return;
  }
  std::vector<StoredField> styles;
  for (const std::string& style : chosen) styles.push_back(ReadStyle(folder, style));
  MakeMixable(folder, chosen, &stored, &styles);

  std::optional<ObjectWeights> object;
  if (settings.object) {
    // That of the first style that has one.
    std::string file;
    for (const std::string& style : chosen)
      if (const std::string found = StyleFolder(folder, style) + "/object.npz";
          file.empty() && !IsFieldFile(style) && fs::exists(found))
        file = found;
    if (file.empty())
      throw InputError("none of the styles has an object", folder,
                       "make it with `regrade stylize " + folder + " --masks FOLDER`");
    object = ReadObjectFile(file, stored.records);
  }
  const std::vector<float>* object_weights = object ? &object->all : nullptr;

  MakeMixFolder(settings.out);
  JsonValue record = JsonValue::Object{{"field", folder}, {"options", options.Values()}};
  for (const std::string& style : chosen) record["styles"].Append(style);
  WriteJsonFile(settings.out + "/mix.json", record);
  WriteMix(settings.out, stored.field, styles, keys, object_weights, cameras, render.fps,
           backend, console);
  if (keys.IsConstant()) {
    std::vector<const RadianceField*> fields;
    for (const StoredField& style : styles) fields.push_back(&style.field);
    StoredField mixed = stored;
    mixed.field = MixFields(stored.field, fields, keys.points[0], object_weights);
    WriteFieldFile(settings.out + "/mixed.npz", mixed);
  }
  console->Info(Concat("wrote ", Counted(std::ssize(cameras.film), "frame"), " of ",
                       Join(chosen, ", "), " to ", settings.out));
}

}  // namespace regrade
