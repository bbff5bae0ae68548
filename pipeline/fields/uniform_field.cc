#include "pipeline/fields/uniform_field.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

// The corners of the cell at a vertex of the new grid.
struct Corners {
  int32_t voxel[8];
  Vec3f fraction;

  bool any() const {
    for (int k = 0; k < 8; ++k)
      if (voxel[k] >= 0 && CornerWeight(fraction, k) > 0) return true;
    return false;
  }
};

class Sampler {
 public:
  Sampler(const Geometry& geometry, const Vec3i& resolution)
      : geometry_(geometry),
        resolution_(resolution),
        cells_(geometry.cells.on() ? ViewOf(geometry.cells, geometry.frame.resolution)
                                   : CellsView{}) {}

  Corners At(int x, int y, int z) const {
    const Vec3i index{x, y, z}, n = geometry_.frame.resolution;
    Vec3f place;  // voxels from the box's corner
    for (int a = 0; a < 3; ++a)
      place[a] = (static_cast<float>(index[a]) + 0.5f) * static_cast<float>(n[a]) /
                 static_cast<float>(resolution_[a]);
    Corners corners;
    std::fill_n(corners.voxel, 8, -1);
    if (!geometry_.cells.on()) {
      const Cell<float> cell = LocateCell(geometry_.frame, place - Vec3f{0.5f, 0.5f, 0.5f});
      for (int k = 0; k < 8; ++k)
        corners.voxel[k] = geometry_.links[CornerVertex(geometry_.frame, cell.vertex, k)];
      corners.fraction = cell.fraction;
      return corners;
    }
    Vec3i at;
    for (int a = 0; a < 3; ++a) at[a] = std::min(static_cast<int>(place[a]), n[a] - 1);
    int width;
    const int32_t cell = CellAt(cells_, at, &width);
    if (cell == kNoCell) return corners;
    for (int a = 0; a < 3; ++a)
      corners.fraction[a] =
          (place[a] - static_cast<float>(at[a] & ~(width - 1))) / static_cast<float>(width);
    std::copy_n(geometry_.cells.corner.data() + 8 * int64_t{cell}, 8, corners.voxel);
    return corners;
  }

 private:
  const Geometry& geometry_;
  Vec3i resolution_;
  CellsView cells_;
};

// out [channels] of values [N, channels].
void Blend(const Corners& corners, const Buffer<float>& values, int channels, float* out) {
  std::fill_n(out, channels, 0.0f);
  for (int k = 0; k < 8; ++k) {
    if (corners.voxel[k] < 0) continue;
    const float w = CornerWeight(corners.fraction, k);
    const float* const from = values.data() + int64_t{corners.voxel[k]} * channels;
    for (int c = 0; c < channels; ++c) out[c] += w * from[c];
  }
}

template <typename Body>
void ForEachVertex(const Vec3i& n, const Body& body) {
#pragma omp parallel for schedule(dynamic, 1)
  for (int x = 0; x < n.x; ++x)
    for (int y = 0; y < n.y; ++y)
      for (int z = 0; z < n.z; ++z) body((int64_t{x} * n.y + y) * n.z + z, x, y, z);
}

void CheckMemory(double bytes, const Vec3i& n, uint64_t memory) {
  if (bytes <= static_cast<double>(memory)) return;
  throw ResourceError("a grid of " + std::to_string(n.x) + " x " + std::to_string(n.y) + " x " +
                          std::to_string(n.z) + " takes " +
                          std::to_string(std::llround(bytes * 1e-6)) + " MB, " +
                          std::to_string(memory / 1000000) + " MB are free",
                      "", "lower --resolution; memory grows with its cube");
}

}  // namespace

Vec3i UniformResolution(const RadianceField& field, int longest) {
  const Vec3i own = field.geometry->frame.resolution;
  const int side = std::max({own.x, own.y, own.z});
  if (longest == 0)
    longest = field.geometry->cells.on() ? std::min(side, kMostUniformVoxels) : side;
  Vec3i resolution;
  for (int a = 0; a < 3; ++a)
    resolution[a] = std::max(
        2, static_cast<int>(std::lround(static_cast<double>(own[a]) * longest / side)));
  return resolution;
}

RadianceField ToUniform(const RadianceField& field, const Vec3i& resolution, uint64_t memory) {
  const Geometry& from = *field.geometry;
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = {resolution, from.frame.center, from.frame.radius};
  geometry->spheres = from.spheres;
  const double vertices = static_cast<double>(geometry->frame.NumVertices());
  CheckMemory(vertices * sizeof(int32_t), resolution, memory);
  const Sampler sampler(from, resolution);
  geometry->links.Resize(geometry->frame.NumVertices());
  ForEachVertex(resolution, [&](int64_t v, int x, int y, int z) {
    geometry->links[v] = sampler.At(x, y, z).any() ? 0 : -1;
  });
  int64_t voxels = 0;
  for (int32_t& link : geometry->links)
    if (link >= 0) link = static_cast<int32_t>(voxels++);
  RadianceField uniform = field;
  const int stride = field.appearance.stride();
  CheckMemory(vertices * sizeof(int32_t) + static_cast<double>(voxels) * 4 * (1 + stride),
              resolution, memory);
  geometry->density.Resize(voxels);
  uniform.appearance.sh = Buffer<float>(voxels * stride);
  ForEachVertex(resolution, [&](int64_t v, int x, int y, int z) {
    const int64_t voxel = geometry->links[v];
    if (voxel < 0) return;
    const Corners corners = sampler.At(x, y, z);
    Blend(corners, from.density, 1, geometry->density.data() + voxel);
    Blend(corners, field.appearance.sh, stride, uniform.appearance.sh.data() + voxel * stride);
  });
  uniform.geometry = std::move(geometry);
  return uniform;
}

}  // namespace regrade
