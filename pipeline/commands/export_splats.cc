#include "pipeline/commands/export_splats.h"

#include <filesystem>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/compared_renders.h"
#include "pipeline/fields/compressed_ply_writer.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/splat_glb.h"
#include "pipeline/fields/splat_ply.h"
#include "pipeline/fields/spz_writer.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

constexpr char kComment[] = "splats by regrade, in the world of the photos' poses";

struct SplatExport {
  const char *format, *ending;
  bool turned;  // to right, up and back
  bool exact;   // holds floats
  void (*write)(const std::string& path, const StoredField& stored);
};

bool IsAntialiased(const StoredField& stored) {
  return stored.field.geometry->splats.fit_pixel == 0;
}

constexpr SplatExport kSplatExports[] = {
    {"ply", ".ply", false, true,
     [](const std::string& path, const StoredField& stored) {
       WriteSplatPly(path, stored, kComment);
     }},
    {"spz", ".spz", true, false,
     [](const std::string& path, const StoredField& stored) {
       WriteSpz(path, WorldSplats(stored), IsAntialiased(stored));
     }},
    {"glb", ".glb", true, true,
     [](const std::string& path, const StoredField& stored) {
       WriteSplatGlb(path, WorldSplats(stored));
     }},
    {"compressed-ply", ".compressed.ply", false, false,
     [](const std::string& path, const StoredField& stored) {
       WriteCompressedPly(path, WorldSplats(stored), IsAntialiased(stored), kComment);
     }}};

const SplatExport* FindExport(const std::string& format) {
  for (const SplatExport& known : kSplatExports)
    if (format == known.format) return &known;
  return nullptr;
}

// What a reader of `path` renders in place of `stored`.
RadianceField ReadBack(const std::string& path, const StoredField& stored) {
  SplatScene scene = ReadSplats(path);
  MoveSplats(stored.field_from_world, &scene.splats);
  scene.splats.background = stored.field.background;
  return FieldOfSplats(scene.splats, stored.field.geometry->frame, stored.field.near_clip,
                       scene.antialiased ? 0.0f : -1.0f);
}

}  // namespace

bool IsSplatExport(const std::string& format) { return FindExport(format) != nullptr; }

void ExportSplats(const ExportOptions& options, const std::string& folder,
                  const std::string& name, const StoredField& stored, Console* console) {
  const SplatExport& format = *FindExport(options.format);
  const std::string to = options.out + "/" + name + format.ending;
  format.write(to, stored);
  const int64_t count = stored.field.geometry->num_voxels();
  std::string text = Concat("wrote ", to, ": ", count, " splats of ",
                            Format("%.1f", static_cast<double>(std::filesystem::file_size(to)) /
                                               static_cast<double>(count)),
                            " bytes");
  if (!format.exact) {
    const std::vector<Camera> cameras = ViewsOf(folder, stored, kComparedViews);
    text += "; " + LossText(RendersOf(stored.field, cameras),
                            RendersOf(ReadBack(to, stored), cameras));
  }
  console->Info(text);
}

void WriteCamerasAndTransform(const ExportOptions& options, const std::string& folder) {
  std::vector<BareCamera> cameras;
  for (const CaptureView& view : ReadPosedCapture(folder).views)
    cameras.push_back({view.file, view.camera.Undistorted()});
  WriteCamerasJson(options.out + "/cameras.json", cameras);
  const Mat3d turn = FindExport(options.format)->turned ? HalfTurnAboutX() : Mat3d();
  JsonValue::Array rows;
  for (const Vec3d& row : turn.row) rows.push_back(JsonValue::Array{row.x, row.y, row.z, 0.0});
  rows.push_back(JsonValue::Array{0.0, 0.0, 0.0, 1.0});
  WriteJsonFile(options.out + "/transform.json",
                JsonValue::Object{{"world_from_file", std::move(rows)}});
}

}  // namespace regrade
