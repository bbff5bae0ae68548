// regrade export: writes photos and poses, or the fields, of an output folder in formats of
// other programs.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/surface_points.h"
#include "pipeline/fields/uniform_field.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/program/memory.h"
#include "pipeline/run/run_file.h"
#include "pipeline/splat_files/splat_ply.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "reconstruct/colmap/colmap_text.h"
#include "stylize/fit_color_table.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  std::string out;
  std::string format = "colmap-text";
  std::string name;
  int resolution = 0;
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the folder to write, a new or empty one; of cube the file"});
    bind("format", format,
         {.help =
              "colmap-text and colmap write images/ and sparse/; transforms writes images/ "
              "and transforms.json for nerfstudio and instant-ngp; svox2 writes field.npz and "
              "each style's NAME.npz on uniform grids; ply writes field.ply and each style's "
              "NAME.ply: splats as viewers and editors of splats open them, of voxels points "
              "with colours, approximately on the surfaces; cube writes one style as a LUT for "
              "photo and video editors, to the file --out",
          .choices = "colmap-text|colmap|transforms|svox2|ply|cube"});
    bind("name", name, {.help = "of cube: the style; by default the last one"});
    bind("resolution", resolution,
         {.unit = "voxels",
          .help = "of svox2: longest side of the grid. 0 copies a uniform field, and takes the "
                  "finest level of an adaptive one, up to 512; memory grows with its cube",
          .min = 0,
          .max = 1290});
    bind("dry-run", dry_run, {.help = "prints what would be written, and does nothing"});
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

constexpr int kComparedViews = 3;

// Some views, evenly spaced, in a field's frame.
std::vector<Camera> ViewsOf(const std::string& folder, const StoredField& stored, int most) {
  constexpr int kSize = 400;  // pixels of the longer side
  const WorkingViews views = ReadWorkingViews(folder + "/poses", kSize, 0).InField(stored);
  const int count = std::min(most, views.count());
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) cameras.push_back(views.CameraOf(views.count() * i / count));
  return cameras;
}

std::vector<Image> Renders(const RadianceField& field, const std::vector<Camera>& cameras) {
  const FieldRenderer renderer(field, Backend::kCpu);
  std::vector<Image> renders;
  for (const Camera& camera : cameras) renders.push_back(renderer.Render(camera).color);
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
void ExportField(const ExportOptions& options, const std::string& folder,
                 const std::string& name, StoredField stored, Console* console) {
  const std::string to = options.out + "/" + name + ".npz";
  const Vec3i own = stored.field.geometry->frame.resolution;
  const Vec3i n = UniformResolution(stored.field, options.resolution);
  const std::string size =
      std::to_string(n.x) + "x" + std::to_string(n.y) + "x" + std::to_string(n.z);
  if (!stored.field.geometry->cells.on() && n == own) {
    WriteFieldFile(to, stored);
    console->Info("wrote " + to + ": a uniform grid of " + size);
    return;
  }
  const std::vector<Camera> cameras = ViewsOf(folder, stored, kComparedViews);
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

void ExportSplats(const ExportOptions& options, const std::string& name,
                  const StoredField& stored, Console* console) {
  const std::string to = options.out + "/" + name + ".ply";
  WriteSplatPly(to, stored, "splats by regrade, in the world of the photos' poses");
  console->Info(Concat("wrote ", to, ": ", stored.field.geometry->num_voxels(), " splats"));
}

void ExportPoints(const ExportOptions& options, const std::string& folder,
                  const std::string& name, const StoredField& stored, Console* console) {
  constexpr int kViews = 60, kResolution = 512;
  const std::vector<SurfacePoint> points =
      SurfacePoints(stored.field, ViewsOf(folder, stored, kViews), kResolution);
  const std::string to = options.out + "/" + name + ".ply";
  WritePly(to, points, stored.field_from_world,
           "approximate: points at the expected depth of rays, colours as photos saw them");
  console->Info(
      Concat("wrote ", to, ": ", Counted(std::ssize(points), "point"), ", approximate"));
}

void ExportFields(const ExportOptions& options, const std::string& folder, Console* console) {
  if (!fs::exists(folder + "/field.npz"))
    throw InputError("holds no reconstruction", folder,
                     "make one with `regrade run` or `regrade reconstruct`");
  std::vector<std::string> left;
  const std::vector<std::string> styles = LearnedStyles(folder, &left);
  if (!left.empty()) console->Info(LeftOutText(folder, left));
  if (options.dry_run) {
    console->Info(Concat("the field and ", Counted(std::ssize(styles), "style"),
                         " would be written to ", options.out, " as ", options.format));
    return;
  }
  CheckResults(folder, styles);
  StoredField field = ReadFieldFile(folder + "/field.npz");
  if (options.format == "svox2" && field.field.geometry->splats.on())
    throw UsageError("svox2 reads voxels, and this field has splats", "--format svox2",
                     "use --format ply, or fit the scene with --field voxels");
  MakeEmptyFolder(options.out, "");
  const auto write = [&](const std::string& name, StoredField stored) {
    if (stored.field.geometry->splats.on())
      ExportSplats(options, name, stored, console);
    else if (options.format == "ply")
      ExportPoints(options, folder, name, stored, console);
    else
      ExportField(options, folder, name, std::move(stored), console);
  };
  write("field", std::move(field));
  for (const std::string& style : styles)
    write(style == "field" ? "field-style" : style,
          ReadStyledField(folder, StyleFolder(folder, style)));
}

// The map of a retouch that is one map of colours, at the style's strength; size 0 for others.
ColorTable OwnMapOf(const std::string& style) {
  if (!fs::exists(style + "/" + kRetouchRecord) || fs::exists(style + "/layers")) return {};
  const ColorLut lut = ReadCubeFile(style + "/" + kEditLut);
  const RunFile run = ReadRunFile(style + "/run.json");
  const JsonValue* value = run.options.Find("strength");
  const double strength = value != nullptr ? value->AsDouble() : 1;
  return TabulateColors(lut.table.size,
                        [&](const Vec3d& c) { return c * (1 - strength) + lut(c) * strength; });
}

// The style as one map of colours: fitted to renders before and after, on views that it is not
// measured on.
void ExportLut(const ExportOptions& options, const std::string& folder, Console* console) {
  constexpr int kViews = 12, kSize = 33, kStride = 4;  // of pixels
  const std::string name = ChosenStyle(folder, options.name);
  const std::string style = StyleFolder(folder, name);
  const ColorTable own = OwnMapOf(style);
  if (own.size == 0) ChosenLearnedStyle(folder, name);
  if (options.dry_run) {
    console->Info(Concat("style ", name, " would be written to ", options.out, " as a LUT of ",
                         kSize, "^3 colours"));
    return;
  }
  if (own.size > 0) {
    WriteFileAtomically(options.out, CubeText(own, name));
    return console->Info(Format(
        "wrote %s: the edit's own map of colours as a LUT of %d^3 colours, which magnifies "
        "differences at most %.2f times",
        options.out.c_str(), own.size, SteepestSlope(own)));
  }
  CheckResults(folder, {name});
  const StoredField stored = ReadFieldFile(folder + "/field.npz");
  const std::vector<Camera> cameras = ViewsOf(folder, stored, kViews);
  const std::vector<Image> before = Renders(stored.field, cameras),
                           after = Renders(ReadStyledField(folder, style).field, cameras);
  const auto color = [](const Image& image, int64_t i) {
    Vec3d c;
    for (int k = 0; k < 3; ++k)
      c[k] = std::clamp(double{image.pixels[static_cast<size_t>(3 * i + k)]}, 0.0, 1.0);
    return c;
  };
  TableFit fit(kSize);
  for (size_t v = 0; v<before.size(); v += before.size()> 1 ? 2 : 1)
    for (int64_t i = 0; i < before[v].num_pixels(); i += kStride)
      fit.Add(color(before[v], i), color(after[v], i));
  const ColorTable table = fit.Solve();
  WriteFileAtomically(options.out, CubeText(table, name));
  double sum = 0, count = 0;
  for (size_t v = before.size() > 1 ? 1 : 0; v < before.size(); v += 2)
    for (int64_t i = 0; i < before[v].num_pixels(); ++i, count += 3) {
      const Vec3d d = table(color(before[v], i)) - color(after[v], i);
      sum += Dot(d, d);
    }
  console->Info(Format(
      "wrote %s: style %s as a LUT of %d^3 colours; on renders it is %.1f dB from the styled "
      "scene, which may differ from place to place, and magnifies differences at most %.2f "
      "times",
      options.out.c_str(), name.c_str(), kSize,
      -10 * std::log10(std::max(sum / std::max(count, 1.0), 1e-12)), SteepestSlope(table)));
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
  const bool fields = settings.format == "svox2" || settings.format == "ply";
  if (settings.resolution != 0 && settings.format != "svox2")
    throw UsageError("is of --format svox2 only", "--resolution");
  if (settings.format == "cube") return ExportLut(settings, folder, console);
  if (!settings.name.empty()) throw UsageError("is of --format cube only", "--name");
  fields ? ExportFields(settings, folder, console) : ExportCapture(settings, folder, console);
}

}  // namespace regrade
