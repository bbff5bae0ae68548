// regrade export: writes photos and poses of an output folder in formats of other programs.
// (field.npz and styled.npz are in svox2's format already.)
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/commands/command.h"
#include "reconstruct/colmap/colmap_text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  std::string out;
  std::string format = "colmap-text";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the folder to write: a new or empty one"});
    bind("format", format,
         {.help = "colmap-text and colmap write images/ and sparse/; transforms writes images/ "
                  "and transforms.json for nerfstudio and instant-ngp",
          .choices = "colmap-text|colmap|transforms"});
  }
};

void MakeEmptyFolder(const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_empty(folder, error))
    throw UsageError("is not empty", folder.string(), "name a new folder with --out");
  fs::create_directories(folder / "images", error);
  if (error) throw ResourceError(error.message(), folder.string());
}

void WritePoses(const ExportOptions& options, const std::string& folder,
                const Capture& capture) {
  if (options.format == "transforms") {
    std::vector<TransformsFrame> frames;
    for (const CaptureView& view : capture.views)
      frames.push_back({"images/" + view.name, view.camera});
    WriteTransformsJson(options.out + "/transforms.json", frames);
    return;
  }
  const ColmapModel model = ReadColmapModel(folder + "/poses/sparse");
  fs::create_directories(options.out + "/sparse");
  if (options.format == "colmap")
    WriteColmapModel(model, options.out + "/sparse");
  else
    WriteColmapText(model, options.out + "/sparse");
}

}  // namespace

void RunExport(const Command& command, const Arguments& arguments, Console* console) {
  ExportOptions settings;
  ProgramOptions program;
  OptionSet options;
  options.Add("Export", &settings);
  options.Add("Program", &program);
  const auto prepared = Prepare(command, arguments, {}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  RequireValue(settings.out, "--out", "name the folder to write");
  if (!fs::exists(folder + "/poses/photos.json"))
    throw InputError("has no poses", folder,
                     "run `regrade pose PHOTOS --out " + folder + "` first");
  const Capture capture = ReadCapture(folder + "/poses");
  MakeEmptyFolder(settings.out);
  for (const CaptureView& view : capture.views) {
    std::error_code error;
    fs::copy_file(view.path, settings.out + "/images/" + view.name, error);
    if (error) throw ResourceError(error.message(), settings.out + "/images/" + view.name);
  }
  WritePoses(settings, folder, capture);
  console->Info(
      Concat("wrote ", capture.views.size(), " photos and their poses to ", settings.out));
}

}  // namespace regrade
