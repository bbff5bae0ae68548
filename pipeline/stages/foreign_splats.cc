#include "pipeline/stages/foreign_splats.h"

#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/files/text.h"
#include "pipeline/program/memory.h"
#include "pipeline/run/plan.h"
#include "reconstruct/views/scene_extent.h"

namespace regrade {
namespace {

const char* NameOf(SplatFormat format) {
  switch (format) {
    case SplatFormat::kPly:
      return "PLY";
    case SplatFormat::kCompressedPly:
      return "compressed PLY";
    case SplatFormat::kSpz:
      return "SPZ";
    case SplatFormat::kSplat:
      return ".splat";
  }
  return "";
}

}  // namespace

int DegreeOf(int basis) { return static_cast<int>(std::lround(std::sqrt(basis))) - 1; }

SplatScene ReadForeignSplats(const std::string& path, double max_memory_gb, Console* console) {
  const uint64_t memory = PlannedMemory(max_memory_gb, ReadMemoryStatus().available);
  SplatScene scene = memory > 0 ? ReadSplats(path, memory) : ReadSplats(path);
  if (console == nullptr) return scene;
  const std::string name = std::filesystem::path(path).filename().string();
  const auto info = [&](const std::string& text) { console->Info(name + ": " + text); };
  info(Concat(scene.splats.count(), " splats with colours of degree ",
              DegreeOf(scene.splats.basis), ", ", NameOf(scene.format),
              (scene.antialiased ? ", antialiased" : "")));
  if (scene.dropped > 0)
    info(Concat(scene.dropped, " splats cannot be drawn and are left out, the first is number ",
                scene.first_dropped));
  for (const std::string& note : scene.notes) info(note);
  if (!scene.ignored.empty())
    console->Detail(name + ": not read: " + Join(scene.ignored, ", "));
  return scene;
}

RadianceField FieldInItsWorld(const SplatScene& scene) {
  const SplatExtent extent = ExtentOf(scene.splats);
  const auto radius = static_cast<float>(extent.radius);
  return FieldOfSplats(scene.splats,
                       {{}, extent.center.Cast<float>(), {radius, radius, radius}}, 0,
                       scene.antialiased ? 0.0f : -1.0f);
}

}  // namespace regrade
