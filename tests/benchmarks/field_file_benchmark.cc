// field_file_benchmark X Y Z VOXELS BASIS FILE: writes a random field of this grid and number
// of voxels, reads it back, and prints seconds and the peak memory beyond what was held.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "kernels/base/random.h"
#include "pipeline/fields/field_file.h"
#include "tests/support/peak_memory.h"

namespace regrade {
namespace {

StoredField RandomField(const Vec3i& resolution, int64_t voxels, int basis) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = resolution;
  const int64_t vertices = geometry->frame.NumVertices();
  geometry->links.Resize(vertices);
  // Runs of 64 vertices along z are stored or empty, evenly spread.
  const double fraction = static_cast<double>(voxels) / static_cast<double>(vertices);
  int32_t count = 0;
  for (int64_t v = 0; v < vertices; ++v) {
    const double run = static_cast<double>(v / 64);
    const bool stored = std::floor((run + 1) * fraction) > std::floor(run * fraction);
    geometry->links[v] = stored ? count++ : -1;
  }
  StoredField stored;
  geometry->density.Resize(count);
  Appearance& appearance = stored.field.appearance;
  appearance.basis = basis;
  appearance.sh.Resize(count * appearance.stride());
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < appearance.sh.size(); ++i)
    appearance.sh[i] = static_cast<float>(RandomDouble(1, 2, static_cast<uint64_t>(i))) - 0.5f;
  stored.field.geometry = std::move(geometry);
  return stored;
}

// Runs `work` and prints its seconds and the memory it needed.
template <typename Work>
void Measure(const char* what, int64_t voxels, const Work& work) {
  testing::ResetPeakMemory();
  const int64_t held = testing::PeakMemory();
  const auto begin = std::chrono::steady_clock::now();
  work();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const double peak = static_cast<double>(testing::PeakMemory() - held);
  std::printf("%s: %.1f s; held %.3f GB, peak %.3f GB above, %.1f B a voxel\n", what,
              seconds.count(), static_cast<double>(held) * 1e-9, peak * 1e-9,
              peak / static_cast<double>(voxels));
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 7) {
    std::fprintf(stderr, "usage: field_file_benchmark X Y Z VOXELS BASIS FILE\n");
    return 2;
  }
  const regrade::Vec3i resolution{std::atoi(argv[1]), std::atoi(argv[2]), std::atoi(argv[3])};
  const std::string path = argv[6];
  try {
    regrade::StoredField field =
        regrade::RandomField(resolution, std::atoll(argv[4]), std::atoi(argv[5]));
    const int64_t voxels = field.field.geometry->num_voxels();
    regrade::Measure("write", voxels, [&] { regrade::WriteFieldFile(path, field); });
    field = {};
    std::printf("file: %.3f GB, %lld voxels\n",
                static_cast<double>(std::filesystem::file_size(path)) * 1e-9,
                static_cast<long long>(voxels));
    regrade::Measure("read", voxels, [&] { field = regrade::ReadFieldFile(path); });
    return field.field.geometry->num_voxels() == voxels ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
