// The rays that a residual by voxel is fitted to, as a sparse matrix: a row a ray.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

// Symbols of EQ(voxel-residual).
struct ResidualRays {
  std::vector<int64_t> first{0};  // [rays + 1]
  std::vector<int32_t> voxel;     // each once a ray
  std::vector<float> weight;      // W_rv
  std::vector<Vec3f> missing;     // [rays]: t
  std::vector<float> share;       // [rays]: m

  int64_t num_rays() const { return std::ssize(missing); }
};

// Of a view's pixels `most` at random, all where it has no more; those whose `missing` [H, W,
// 3] is not finite do not count. `directions`, if asked for, gets each ray's, or of
// splats one for each of `voxel`, see RayWeights::directions.
void AddResidualRays(const RadianceField& field, const Camera& camera, const Image& missing,
                     int64_t most, uint64_t seed, ResidualRays* rays,
                     std::vector<Vec3f>* directions = nullptr);

// y = W x: [rays] of [voxels].
std::vector<Vec3d> SumAlongRays(const ResidualRays& rays, const std::vector<Vec3d>& x);

}  // namespace regrade
