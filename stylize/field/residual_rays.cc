#include "stylize/field/residual_rays.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/trilinear.h"
#include "kernels/render/ray_weigher.h"

namespace regrade {

void AddResidualRays(const RadianceField& field, const Camera& camera, const Image& missing,
                     int64_t most, uint64_t seed, ResidualRays* rays,
                     std::vector<Vec3f>* directions) {
  REGRADE_CHECK(missing.width == camera.width && missing.height == camera.height);
  constexpr float kLeastWeight = 1e-4f;
  const double chosen =
      std::min(1.0, static_cast<double>(most) / static_cast<double>(missing.num_pixels()));
  const bool own_directions = KindOf(*field.geometry).own_directions;
  ViewRays some{.cameras = {camera}};
  for (int64_t i = 0; i < missing.num_pixels(); ++i) {
    if (!(RandomDouble(seed, 0, static_cast<uint64_t>(i)) < chosen)) continue;
    const float* p = &missing.pixels[static_cast<size_t>(3 * i)];
    const Vec3f lack{p[0], p[1], p[2]};
    if (!AllFinite(lack)) continue;
    some.AddPixel(0, static_cast<int>(i % missing.width), static_cast<int>(i / missing.width));
    if (directions && !own_directions) directions->push_back(some.rays.back().direction);
    rays->missing.push_back(lack);
    rays->share.push_back(static_cast<float>(1 / chosen));
  }
  constexpr int64_t kBand = 16384;
  const Geometry& geometry = *field.geometry;
  const std::unique_ptr<RayWeigher> weigher =
      MakeRayWeigher(geometry, field.near_clip, field.march, kLeastWeight);
  struct Entry {
    int32_t voxel;
    float weight;
    int64_t sample;
  };
  std::vector<Entry> row;
  for (int64_t begin = 0; begin < some.size(); begin += kBand) {
    const int64_t count = std::min(kBand, some.size() - begin);
    const RayWeights weights = weigher->Weigh(some, begin, begin + count);
    for (int64_t r = 0; r < count; ++r) {
      row.clear();
      for (int64_t i = weights.first[static_cast<size_t>(r)];
           i < weights.first[static_cast<size_t>(r) + 1]; ++i) {
        const WeightedSample& sample = weights.samples[static_cast<size_t>(i)];
        int32_t points[8];
        CornerPoints(geometry, sample, points);
        for (int k = 0; k < 8; ++k)
          if (points[k] >= 0 && points[k] < geometry.num_voxels())
            row.push_back({points[k], sample.weight * CornerWeight(sample.fraction, k), i});
      }
      std::stable_sort(row.begin(), row.end(),
                       [](const Entry& a, const Entry& b) { return a.voxel < b.voxel; });
      for (size_t i = 0; i < row.size(); ++i) {
        if (i > 0 && row[i].voxel == row[i - 1].voxel) {
          rays->weight.back() += row[i].weight;
          continue;
        }
        rays->voxel.push_back(row[i].voxel);
        rays->weight.push_back(row[i].weight);
        if (directions && own_directions)
          directions->push_back(weights.directions[static_cast<size_t>(row[i].sample)]);
      }
      rays->first.push_back(std::ssize(rays->voxel));
    }
  }
}

std::vector<Vec3d> SumAlongRays(const ResidualRays& rays, const std::vector<Vec3d>& x) {
  std::vector<Vec3d> y(rays.missing.size());
#pragma omp parallel for schedule(static)
  for (int64_t r = 0; r < rays.num_rays(); ++r) {
    Vec3d sum{};
    const size_t row = static_cast<size_t>(r);
    for (int64_t i = rays.first[row]; i < rays.first[row + 1]; ++i)
      sum += x[static_cast<size_t>(rays.voxel[static_cast<size_t>(i)])] *
             double{rays.weight[static_cast<size_t>(i)]};
    y[row] = sum;
  }
  return y;
}

}  // namespace regrade
