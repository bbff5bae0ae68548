#include "pipeline/commands/export_fields.h"

#include <filesystem>
#include <optional>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/commands/compared_renders.h"
#include "pipeline/commands/export_splats.h"
#include "pipeline/commands/page_styles.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/surface_points.h"
#include "pipeline/files/text.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/stages/splats_of_voxels.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

void ExportGrid(const ExportOptions& options, const std::string& name,
                const StoredField& stored, Console* console) {
  const std::string to = options.out + "/" + name + ".npz";
  WriteFieldFile(to, stored);
  const Vec3i n = stored.field.geometry->frame.resolution;
  console->Info(Concat("wrote ", to, ": a grid of ", n.x, "x", n.y, "x", n.z));
}

void ExportPoints(const ExportOptions& options, const std::string& folder,
                  const std::string& name, const StoredField& stored, Console* console) {
  constexpr int kViews = 60, kResolution = 512;
  const std::vector<SurfacePoint> points =
      SurfacePoints(stored.field, ViewsOf(folder, stored, kViews), kResolution);
  const std::string to = options.out + "/" + name + ".ply";
  WritePly(to, points, stored.field_from_world,
           "approximate: points at the depth of rays, colours as photos saw them");
  console->Info(
      Concat("wrote ", to, ": ", Counted(std::ssize(points), "point"), ", approximate"));
}

void CheckSuits(const ExportOptions& options, bool splats) {
  if (splats && options.thousands_given)
    throw UsageError("is of voxels that become splats, and this field has splats", "--splats",
                     "leave it out: they are written as they are");
  if (splats && !IsSplatExport(options.format))
    throw UsageError(
        "is of voxels, and this field has splats", "--format " + options.format,
        "use --format ply, spz, glb or compressed-ply, or fit the scene with --field voxels");
}

RunSettings SettingsOf(const std::string& folder) {
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  ResolveSettings({.run_json = folder + "/run.json"}, &options);
  return settings;
}

// Fits splats to voxels: the geometry once to the scene, and colours to each style.
class VoxelsAsSplats {
 public:
  VoxelsAsSplats(const std::string& folder, const ExportOptions& options,
                 const StoredField& scene, Console* console)
      : fit_(ReadCapture(folder + "/poses"), SettingsOf(folder),
             {.thousands = options.thousands}, ChooseBackend("auto", false)),
        console_(console) {
    console->BeginStage("splats");
    splats_ = fit_.Fit(scene, console->StageProgress());
    console->EndStage();
    SayLoss("field", scene, splats_);
  }

  const StoredField& Scene() const { return splats_; }

  StoredField Style(const std::string& name, const StoredField& styled) {
    console_->BeginStage("colours");
    StoredField splats = fit_.Recolor(styled, console_->StageProgress());
    console_->EndStage();
    SayLoss(name, styled, splats);
    return splats;
  }

 private:
  void SayLoss(const std::string& name, const StoredField& voxels,
               const StoredField& splats) const {
    const double db = PsnrOf(RendersOf(voxels.field, fit_.MeasuredViews(voxels)),
                             RendersOf(splats.field, fit_.MeasuredViews(splats)));
    console_->Info(Format("%s: renders of %lld splats are %.1f dB from the voxels' own, on ",
                          name.c_str(),
                          static_cast<long long>(splats.field.geometry->num_voxels()), db) +
                   Counted(kMeasuredNearby, "view") + " that took no part in the fit");
  }

  SplatsOfVoxels fit_;
  Console* console_;
  StoredField splats_;
};

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
  const bool splats = CountSplats(folder + "/field.npz") > 0;
  CheckSuits(options, splats);
  if (options.dry_run) {
    console->Info(Concat(options.names.empty() ? "the field and " : "",
                         Counted(std::ssize(styles), "style"), " would be written to ",
                         options.out, " as ", options.format));
    return;
  }
  StoredField field = ReadFieldFile(folder + "/field.npz");
  MakeEmptyFolder(options.out, "");
  std::optional<VoxelsAsSplats> fitted;
  if (IsSplatExport(options.format) && !splats) fitted.emplace(folder, options, field, console);
  const auto write = [&](const std::string& name, const StoredField& stored) {
    if (IsSplatExport(options.format))
      ExportSplats(options, folder, name, stored, console);
    else if (options.format == "points")
      ExportPoints(options, folder, name, stored, console);
    else
      ExportGrid(options, name, stored, console);
  };
  if (IsSplatExport(options.format)) WriteCamerasAndTransform(options, folder);
  if (options.names.empty()) write("field", fitted ? fitted->Scene() : field);
  for (const std::string& style : styles) {
    StoredField styled = ReadStyledField(folder, StyleFolder(folder, style));
    if (fitted) styled = fitted->Style(style, styled);
    write(style == "field" ? "field-style" : style, styled);
  }
}

}  // namespace regrade
