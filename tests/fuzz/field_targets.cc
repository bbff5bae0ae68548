// Fuzz targets: field.npz; accepted fields are rendered.
#include <cmath>
#include <cstring>
#include <optional>

#include "kernels/field/cpu/render_view.h"
#include "kernels/field/render.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/npz_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/stored_zip.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_field.h"

namespace regrade::testing {
namespace {

constexpr uint64_t kBudget = 4 << 20;

std::string StoredField(bool spheres, bool ndc) {
  regrade::StoredField stored;
  stored.field = RandomField({4, 3, 5}, spheres ? 1 : 4, 0.6, 3);
  if (spheres) AddSpheres(3, 4, 0.7, 4, &stored.field);
  if (ndc) stored.ndc = {1.5, 2};
  const std::string path = FuzzFolder() + "/seed_field.npz";
  WriteFieldFile(path, stored);
  return StoredCopyOfNpz(path);
}

std::vector<std::string> FieldSeeds() {
  return {StoredField(false, false), StoredField(true, false), StoredField(false, true)};
}

constexpr int32_t kCellsVersion = 2;  // of files that are not read

int32_t VersionOf(const std::string& path) {
  NpzReader file(path, kBudget);
  return file.Has("regrade_version") ? file.ReadScalar<int32_t>("regrade_version") : 0;
}

bool ReadField(std::string_view bytes) {
  const std::string path = FuzzFile("field.npz", bytes);
  return Accepts([&path] {
    const regrade::StoredField stored = ReadFieldFile(path, kBudget);
    FuzzRequire(VersionOf(path) != kCellsVersion, "its field has no cells");
    const Similarity& placement = stored.field_from_world;
    bool finite = std::isfinite(placement.scale) && placement.scale > 0;
    for (int i = 0; i < 3; ++i) {
      finite = finite && std::isfinite(placement.translation[i]);
      for (int j = 0; j < 3; ++j) finite = finite && std::isfinite(placement.rotation(i, j));
    }
    FuzzRequire(finite, "its place in the world is finite");
    Camera camera = testing::PinholeOf(4, 3, 4);
    const Vec3f center = stored.field.geometry->frame.center,
                radius = stored.field.geometry->frame.radius;
    camera.camera_from_world.translation = {-center.x, -center.y, 2.0 * radius.z - center.z};
    const RenderedView view =
        RenderView(stored.field, camera, {stored.field.march.step, 1e-3f});
    for (const float value : view.color.pixels)
      FuzzRequire(value >= 0 && value <= 1, "its colours are in [0, 1]");
  });
}

// Now and then it becomes a file of cells.
std::string MutateField(std::string bytes, FuzzRandom* random) {
  std::optional<std::vector<ZipPart>> parts;
  if (random->Chance(0.02)) parts = TakeStoredZip(bytes);
  if (!parts) return MutateNpz(std::move(bytes), random);
  for (ZipPart& part : *parts) {
    if (part.name == "links.npy") part.name = "regrade_cells_key.npy";
    if (part.name == "regrade_version.npy" && part.bytes.size() > sizeof kCellsVersion)
      std::memcpy(part.bytes.data() + part.bytes.size() - sizeof kCellsVersion, &kCellsVersion,
                  sizeof kCellsVersion);
  }
  if (random->Chance(0.5)) return BuildStoredZip(*parts);
  return MutateNpz(BuildStoredZip(*parts), random);
}

}  // namespace

std::vector<FuzzTarget> FieldTargets() {
  return {{"field_npz", FieldSeeds, ReadField, MutateField, 5000}};
}

}  // namespace regrade::testing
