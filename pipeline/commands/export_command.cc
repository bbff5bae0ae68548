// regrade export: writes photos and poses, or the fields, of an output folder in formats of
// other programs.
#include <filesystem>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/export_fields.h"
#include "pipeline/commands/export_lut.h"
#include "pipeline/commands/export_options.h"
#include "pipeline/commands/export_splats.h"
#include "pipeline/files/text.h"
#include "pipeline/workspace/style_folders.h"
#include "reconstruct/colmap/colmap_text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

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

void ExportCapture(const ExportOptions& options, const std::string& folder, Console* console) {
  CheckResults(folder, {});
  const Capture capture = ReadPosedCapture(folder);
  if (options.dry_run) {
    console->Info(Concat(Counted(std::ssize(capture.views), "photo"),
                         " with poses would be written to ", options.out));
    return;
  }
  MakeEmptyFolder(options.out, "images");
  for (const CaptureView& view : capture.views) {
    const std::string to = options.out + "/images/" + view.name;
    std::error_code error;
    fs::copy_file(view.path, to, error);
    if (error) throw ResourceError(error.message(), to);
  }
  WritePoses(options, folder, capture);
  console->Info(Concat("wrote ", Counted(std::ssize(capture.views), "photo"), " with poses to ",
                       options.out));
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
  RequireValue(settings.out, "--out", "name the folder or file to write");
  settings.thousands_given = options.Given("splats").has_value();
  if (settings.thousands_given && !IsSplatExport(settings.format))
    throw UsageError("is of formats of splats", "--splats",
                     "add --format ply, or leave it out");
  const bool fields = settings.format == "svox2" || settings.format == "points" ||
                      IsSplatExport(settings.format);
  if (settings.format == "cube") return ExportLut(settings, folder, console);
  if (fields) return ExportFields(settings, folder, console);
  if (!settings.names.empty())
    throw UsageError("is of formats of styles, not of photos and poses", "--name",
                     "add a --format such as ply");
  ExportCapture(settings, folder, console);
}

}  // namespace regrade
