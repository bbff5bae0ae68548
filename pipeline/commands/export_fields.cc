#include "pipeline/commands/export_fields.h"

#include <filesystem>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/commands/compared_renders.h"
#include "pipeline/commands/export_splats.h"
#include "pipeline/commands/page_styles.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/surface_points.h"
#include "pipeline/fields/uniform_field.h"
#include "pipeline/files/text.h"
#include "pipeline/program/memory.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// On a uniform grid.
void ExportGrid(const ExportOptions& options, const std::string& folder,
                const std::string& name, StoredField stored, Console* console) {
  const std::string to = options.out + "/" + name + ".npz";
  const Vec3i own = stored.field.geometry->frame.resolution;
  const Vec3i n = UniformResolution(stored.field, options.resolution);
  const std::string grid =
      Concat("wrote ", to, ": a uniform grid of ", n.x, "x", n.y, "x", n.z);
  if (!stored.field.geometry->cells.on() && n == own) {
    WriteFieldFile(to, stored);
    console->Info(grid);
    return;
  }
  const std::vector<Camera> cameras = ViewsOf(folder, stored, kComparedViews);
  const std::vector<Image> before = RendersOf(stored.field, cameras);
  stored.field = ToUniform(stored.field, n, ReadMemoryStatus().available);
  WriteFieldFile(to, stored);
  stored = {};
  console->Info(grid + "; " + LossText(before, RendersOf(ReadFieldFile(to).field, cameras)));
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

void CheckSuits(const std::string& format, const StoredField& stored) {
  const bool splats = stored.field.geometry->splats.on();
  if (splats == IsSplatExport(format)) return;
  throw UsageError(
      splats ? "is of voxels, and this field has splats"
             : "is of splats, and this field has voxels",
      "--format " + format,
      splats ? "use --format ply, spz, glb or compressed-ply, or fit the scene with --field "
               "voxels"
             : "use --format points or svox2, or fit the scene with --field splats");
}

}  // namespace

void MakeEmptyFolder(const std::string& folder, const std::string& inside) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_empty(folder, error))
    throw UsageError("is not empty", folder, "name a new folder with --out");
  fs::create_directories(fs::path(folder) / inside, error);
  if (error) throw ResourceError(error.message(), folder);
}

void ExportFields(const ExportOptions& options, const std::string& folder, Console* console) {
  Arguments words{folder};
  words.insert(words.end(), options.names.begin(), options.names.end());
  std::vector<std::string> left;
  const std::vector<std::string> styles = WantedStyles(folder, words, &left);
  if (!left.empty()) console->Info(LeftOutText(folder, left));
  if (options.dry_run) {
    console->Info(Concat(options.names.empty() ? "the field and " : "",
                         Counted(std::ssize(styles), "style"), " would be written to ",
                         options.out, " as ", options.format));
    return;
  }
  StoredField field = ReadFieldFile(folder + "/field.npz");
  CheckSuits(options.format, field);
  MakeEmptyFolder(options.out, "");
  const auto write = [&](const std::string& name, StoredField stored) {
    if (IsSplatExport(options.format))
      ExportSplats(options, folder, name, stored, console);
    else if (options.format == "points")
      ExportPoints(options, folder, name, stored, console);
    else
      ExportGrid(options, folder, name, std::move(stored), console);
  };
  if (IsSplatExport(options.format)) WriteCamerasAndTransform(options, folder);
  if (options.names.empty()) write("field", std::move(field));
  for (const std::string& style : styles)
    write(style == "field" ? "field-style" : style,
          ReadStyledField(folder, StyleFolder(folder, style)));
}

}  // namespace regrade
