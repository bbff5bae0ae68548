#include "kernels/field/field_sampler.h"

#include <algorithm>

#include "kernels/field/trilinear.h"

namespace regrade {

bool CellCorners::any() const {
  for (int k = 0; k < 8; ++k)
    if (voxel[k] >= 0 && CornerWeight(fraction, k) > 0) return true;
  return false;
}

FieldSampler::FieldSampler(const Geometry& geometry)
    : geometry_(geometry),
      cells_(geometry.cells.on() ? ViewOf(geometry.cells, geometry.frame.resolution)
                                 : CellsView{}) {}

CellCorners FieldSampler::At(const Vec3f& place) const {
  CellCorners corners;
  std::fill_n(corners.voxel, 8, -1);
  if (!geometry_.cells.on()) {
    const Cell<float> cell = LocateCell(geometry_.frame, place - Vec3f{0.5f, 0.5f, 0.5f});
    for (int k = 0; k < 8; ++k)
      corners.voxel[k] = geometry_.links[CornerVertex(geometry_.frame, cell.vertex, k)];
    corners.fraction = cell.fraction;
    return corners;
  }
  const Vec3i n = geometry_.frame.resolution;
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

float FieldSampler::DensityAt(const Vec3f& world) const {
  const GridFrame& frame = geometry_.frame;
  const Vec3f scale = frame.Scale();
  Vec3f place;
  for (int a = 0; a < 3; ++a) {
    place[a] = (world[a] - frame.center[a] + frame.radius[a]) * scale[a];
    if (!(place[a] >= 0 && place[a] <= static_cast<float>(frame.resolution[a]))) return 0;
  }
  float density;
  Blend(At(place), geometry_.density, 1, &density);
  return std::max(density, 0.0f);
}

void Blend(const CellCorners& corners, const Buffer<float>& values, int channels, float* out) {
  std::fill_n(out, channels, 0.0f);
  for (int k = 0; k < 8; ++k) {
    if (corners.voxel[k] < 0) continue;
    const float w = CornerWeight(corners.fraction, k);
    const float* const from = values.data() + int64_t{corners.voxel[k]} * channels;
    for (int c = 0; c < channels; ++c) out[c] += w * from[c];
  }
}

}  // namespace regrade
