// What rays of pictures see of a field of any kind.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/ray_weights.h"
#include "kernels/scene/view_rays.h"

namespace regrade {

class RayWeigher {
 public:
  virtual ~RayWeigher() = default;

  // Samples that weigh at most this are dropped. It may change between calls.
  float min_weight = 0;

  // Of rays [begin, end). Exact, and in the order of light. The same for any number of threads.
  // One call at a time.
  virtual RayWeights Weigh(const ViewRays& rays, int64_t begin, int64_t end) = 0;
  RayWeights Weigh(const ViewRays& rays) { return Weigh(rays, 0, rays.size()); }
};

// Of kept_bytes: a list takes 4 B for each tile that a splat is in.
inline constexpr int64_t kManyViews = int64_t{1} << 30;

// Voxels are marched, see ComputeRayWeights. Splats have the weights w_i of
// EQ(splat-composite); their cameras are pinholes. Which splats the tiles of a picture show is
// kept for the last camera, and for others while `kept_bytes` last: for rays whose cameras come
// again and again. A place between the centres of pixels sees those of its tile's pixels.
// The geometry must outlive the weigher.
std::unique_ptr<RayWeigher> MakeRayWeigher(const Geometry& geometry, float near_clip,
                                           const MarchOptions& march, float min_weight = 0,
                                           int64_t kept_bytes = 0);

// [rays]: depth along the camera's optical axis of what each ray meets (of splats the median),
// 0 where that is less than half of its light. `weigher`: of the field, with min_weight 0.
std::vector<double> RayDepths(const RadianceField& field, const ViewRays& rays,
                              RayWeigher* weigher);

}  // namespace regrade
