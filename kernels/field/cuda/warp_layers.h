// Composites the background's layers with a warp, 32 layers at a time, from the nearest
// outwards. Device code only.
#pragma once

#include "kernels/field/background_spheres.h"
#include "kernels/field/cuda/warp_march.h"

#if defined(__CUDACC__)

namespace regrade {

// Per-lane state of one layer.
struct LaneLayer {
  int layer = 0;
  TexelCell<float> cell;
  float4 value;     // as SampleLayer returns it: colour coefficients, density
  float depth = 0;  // of the crossing, world units from the ray's origin
  float tau = 0;    // optical depth; 0 if the layer does not composite
  float transmittance_before = 0;

  __device__ Vec3f Color() const {
    const float coefficients[3] = {value.x, value.y, value.z};
    return LayerColor(coefficients);
  }
  __device__ float Weight() const { return transmittance_before * Opacity(tau); }
};

// See EQ(background-layers). `entry` is the transmittance of the box; the ray ends by the rule
// of CompositeSpheres.
class WarpLayers {
 public:
  __device__ WarpLayers(const DeviceGridView& grid, const Ray& ray, float entry, float stop)
      : spheres_(grid.spheres),
        ray_(ToSphereRay(grid.frame, ray)),
        lane_(static_cast<int>(threadIdx.x & 31)),
        entry_(entry),
        stop_(stop),
        delta_(ray_.world_per_unit / static_cast<float>(grid.spheres.layers)) {
    stopped_ = !(entry >= stop) || !(ray_.world_per_unit > 0);
  }

  // Advances to the next 32 layers of which at least one composites; false at the ray's end.
  // Lanes that composite get mine->tau > 0.
  __device__ bool Next(LaneLayer* mine, unsigned* composited) {
    while (first_ < spheres_.layers && !stopped_) {
      *mine = Evaluate(first_, &depth_, composited);
      first_ += 32;
      if (*composited == 0) continue;
      stopped_ = !(transmittance() >= stop_);
      return true;
    }
    return false;
  }

  // Layers first + lane. *depth is the optical depth of the layers before them on entry, and
  // includes them on return.
  __device__ LaneLayer Evaluate(int first, float* depth, unsigned* composited) const {
    LaneLayer mine;
    mine.layer = first + lane_;
    mine.value = make_float4(0, 0, 0, 0);
    Vec3f place;
    float ahead;
    const float u = InverseRadius<float>(mine.layer, spheres_.layers);
    if (mine.layer < spheres_.layers && CrossSphere(ray_, u, &place, &ahead)) {
      mine.cell = LocateTexel(spheres_.resolution, place);
      mine.depth = ahead / u * ray_.world_per_unit;
      Sample(&mine);
    }
    if (mine.value.w > 0) mine.tau = OpticalDepth(mine.value.w, delta_);
    const float before = *depth + InclusiveSum(mine.tau, lane_) - mine.tau;
    mine.transmittance_before = entry_ * expf(-before);
    if (!(mine.transmittance_before >= stop_)) mine.tau = 0;
    *composited = __ballot_sync(kAllLanes, mine.tau > 0);
    if (*composited != 0)
      *depth = __shfl_sync(kAllLanes, before + mine.tau, 31 - __clz(*composited));
    return mine;
  }

  __device__ float transmittance() const { return entry_ * expf(-depth_); }
  __device__ bool is_ray() const { return ray_.world_per_unit > 0; }
  __device__ float delta() const { return delta_; }
  __device__ int lane() const { return lane_; }

 private:
  __device__ void Sample(LaneLayer* mine) const {
    int32_t column[4];
    float4 texel[4];
#pragma unroll
    for (int k = 0; k < 4; ++k) column[k] = spheres_.links[mine->cell.texel[k]];
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const int64_t at = static_cast<int64_t>(column[k]) * spheres_.layers + mine->layer;
      texel[k] = column[k] < 0 ? make_float4(0, 0, 0, 0)
                               : reinterpret_cast<const float4*>(spheres_.texels)[at];
    }
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const float w = mine->cell.weight[k];
      mine->value.x += w * texel[k].x;
      mine->value.y += w * texel[k].y;
      mine->value.z += w * texel[k].z;
      mine->value.w += w * texel[k].w;
    }
  }

  const DeviceSpheresView spheres_;
  const SphereRay<float> ray_;
  const int lane_;
  const float entry_, stop_, delta_;
  int first_ = 0;
  float depth_ = 0;
  bool stopped_ = false;
};

}  // namespace regrade

#endif
