// regrade export: writes photos and poses, or the fields, of an output folder in formats of
// other programs.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/packed_grid.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/uniform_field.h"
#include "pipeline/program/memory.h"
#include "reconstruct/colmap/colmap_text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  std::string out;
  std::string format = "colmap-text";
  int resolution = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the folder to write: a new or empty one"});
    bind("format", format,
         {.help =
              "colmap-text and colmap write images/ and sparse/; transforms writes images/ "
              "and transforms.json for nerfstudio and instant-ngp; svox2 writes field.npz and "
              "styled.npz on uniform grids",
          .choices = "colmap-text|colmap|transforms|svox2"});
    bind("resolution", resolution,
         {.unit = "voxels",
          .help = "of svox2: longest side of the grid. 0 copies a uniform field, and takes the "
                  "finest level of an adaptive one, up to 512; memory grows with its cube",
          .min = 0,
          .max = 1290});
  }
};

void MakeEmptyFolder(const fs::path& folder, const char* inside) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_empty(folder, error))
    throw UsageError("is not empty", folder.string(), "name a new folder with --out");
  fs::create_directories(folder / inside, error);
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

void ExportCapture(const ExportOptions& options, const std::string& folder, Console* console) {
  const Capture capture = ReadPosedCapture(folder);
  MakeEmptyFolder(options.out, "images");
  for (const CaptureView& view : capture.views) {
    const std::string to = options.out + "/images/" + view.name;
    std::error_code error;
    fs::copy_file(view.path, to, error);
    if (error) throw ResourceError(error.message(), to);
  }
  WritePoses(options, folder, capture);
  console->Info(
      Concat("wrote ", capture.views.size(), " photos and their poses to ", options.out));
}

// Three views, evenly spaced, in a field's frame.
std::vector<Camera> ComparedViews(const std::string& folder, const StoredField& stored) {
  constexpr int kSize = 400, kViews = 3;  // pixels of the longer side
  const WorkingViews views = ReadWorkingViews(folder + "/poses", kSize, 0)
                                 .InField(stored.field_from_world, stored.ndc);
  const int count = std::min(kViews, views.count());
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) cameras.push_back(views.CameraOf(views.count() * i / count));
  return cameras;
}

std::vector<Image> Renders(const RadianceField& field, const std::vector<Camera>& cameras) {
  const FastGrid grid = MakeFastGrid(field);
  std::vector<Image> renders;
  for (const Camera& camera : cameras)
    renders.push_back(RenderView(grid, camera, MarchOptions{field.step}).color);
  return renders;
}

// Of all pixels of all pictures together.
double PsnrOf(const std::vector<Image>& a, const std::vector<Image>& b) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t k = 0; k < a[i].pixels.size(); ++k, ++count)
      sum += std::pow(double{a[i].pixels[k]} - double{b[i].pixels[k]}, 2);
  return -10 * std::log10(std::max(sum / std::max(count, 1.0), 1e-12));
}

// One field on a uniform grid; says what its renders lose by that.
void ExportField(const ExportOptions& options, const std::string& folder, const char* name,
                 Console* console) {
  const std::string from = folder + "/" + name, to = options.out + "/" + name;
  StoredField stored = ReadFieldFile(from);
  const Vec3i own = stored.field.geometry->frame.resolution;
  const Vec3i n = UniformResolution(stored.field, options.resolution);
  const std::string size =
      std::to_string(n.x) + "x" + std::to_string(n.y) + "x" + std::to_string(n.z);
  if (!stored.field.geometry->cells.on() && n == own) {
    fs::copy_file(from, to);
    console->Info("copied " + to + ": a uniform grid of " + size);
    return;
  }
  const std::vector<Camera> cameras = ComparedViews(folder, stored);
  const std::vector<Image> before = Renders(stored.field, cameras);
  stored.field = ToUniform(stored.field, n, ReadMemoryStatus().available);
  WriteFieldFile(to, stored);
  stored = {};
  const std::vector<Image> after = Renders(ReadFieldFile(to).field, cameras);
  char text[200];
  std::snprintf(text, sizeof text,
                ": a uniform grid of %s; its renders are %.1f dB from the field's own, on %d "
                "views of 400 pixels",
                size.c_str(), PsnrOf(before, after), static_cast<int>(cameras.size()));
  console->Info("wrote " + to + text);
}

void ExportFields(const ExportOptions& options, const std::string& folder, Console* console) {
  if (!fs::exists(folder + "/field.npz"))
    throw InputError("holds no reconstruction", folder,
                     "make one with `regrade run` or `regrade reconstruct`");
  MakeEmptyFolder(options.out, "");
  for (const char* name : {"field.npz", "styled.npz"})
    if (fs::exists(folder + "/" + name)) ExportField(options, folder, name, console);
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
  const bool fields = settings.format == "svox2";
  if (settings.resolution != 0 && !fields)
    throw UsageError("is of --format svox2 only", "--resolution");
  fields ? ExportFields(settings, folder, console) : ExportCapture(settings, folder, console);
}

}  // namespace regrade
