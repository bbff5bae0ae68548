// Rays weighed on a CUDA device, in lists on the host; for splats, see DeviceSplatWeigher.
#pragma once

#include "kernels/render/ray_weigher.h"
#include "kernels/splats/cuda/device_splat_weigher.h"

namespace regrade {

class DeviceRayWeigher : public RayWeigher {
 public:
  // `weigher` must outlive it.
  DeviceRayWeigher(DeviceSplatWeigher* weigher, float least_weight) : weigher_(*weigher) {
    min_weight = least_weight;
  }

  using RayWeigher::Weigh;
  RayWeights Weigh(const ViewRays& rays, int64_t begin, int64_t end) override;

 private:
  DeviceSplatWeigher& weigher_;
};

}  // namespace regrade
