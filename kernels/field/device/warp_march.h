// One ray, one warp: its 32 lanes look at 32 consecutive samples of the march. Device code
// only.
#pragma once

#include "kernels/field/device/device_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

#if defined(__CUDACC__)

namespace regrade {

inline constexpr unsigned kAllLanes = 0xffffffffu;

// Sum over the lanes up to and including one's own.
__device__ inline float InclusiveSum(float value, int lane) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) {
    const float other = __shfl_up_sync(kAllLanes, value, d);
    if (lane >= d) value += other;
  }
  return value;
}

__device__ inline float WarpSum(float value) {
#pragma unroll
  for (int d = 16; d > 0; d /= 2) value += __shfl_xor_sync(kAllLanes, value, d);
  return value;
}

// What a lane knows of its sample.
struct LaneSample {
  Cell<float> cell;
  float t = 0;    // voxels along the ray
  float tau = 0;  // optical depth; 0 where nothing is composited
  float transmittance_before = 0;
};

// The march of a warp's ray; every lane holds the same state but for its own sample.
class WarpMarch {
 public:
  __device__ WarpMarch(const DeviceGridView& grid, const Ray& ray, const MarchOptions& options)
      : grid_(grid),
        options_(options),
        ray_(ClipToGrid(grid.frame, ray, grid.near_clip, options.step)),
        lane_(static_cast<int>(threadIdx.x & 31)) {
    delta_ = options.step * ray_.world_per_voxel;
  }

  // Steps to the next 32 samples of which at least one composites; false at the ray's end.
  // Lanes that composite get sample->tau > 0; they come in the order of the ray, and the first
  // of them follows the last of the call before. See EQ(composite); the ray ends behind the
  // sample that leaves less than stop_transmittance.
  __device__ bool Next(LaneSample* sample, unsigned* composited) {
    while (step_ < ray_.num_steps && !stopped_) {
      const int64_t mine = step_ + lane_;
      const bool inside = mine < ray_.num_steps;
      sample->t = ray_.t_begin + static_cast<float>(mine) * options_.step;
      int distance = 255;
      if (inside) {
        sample->cell = LocateCell(grid_.frame, ray_.At(sample->t));
        distance = grid_.empty_distance[sample->cell.vertex];
      }
      if (__ballot_sync(kAllLanes, inside && distance == 0) == 0) {
        // Nothing is stored at these 32. Each lane knows how far it stays so.
        const int skip =
            inside
                ? lane_ +
                      max(1, static_cast<int>(static_cast<float>(distance - 1) / options_.step))
                : 32;
        step_ += max(32, __reduce_max_sync(kAllLanes, skip));
        continue;
      }
      step_ += 32;
      sample->tau = 0;
      if (inside && distance == 0) {
        const float density = DensityAt(sample->cell);
        if (density > 0) sample->tau = OpticalDepth(density, delta_);
      }
      const float before = depth_ + InclusiveSum(sample->tau, lane_) - sample->tau;
      sample->transmittance_before = expf(-before);
      if (!(sample->transmittance_before >= options_.stop_transmittance)) sample->tau = 0;
      *composited = __ballot_sync(kAllLanes, sample->tau > 0);
      if (*composited == 0) continue;
      const float after = __shfl_sync(kAllLanes, before + sample->tau, 31 - __clz(*composited));
      depth_ = after;
      stopped_ = !(expf(-after) >= options_.stop_transmittance);
      return true;
    }
    return false;
  }

  __device__ float optical_depth() const { return depth_; }
  __device__ float delta() const { return delta_; }
  __device__ float world_per_voxel() const { return ray_.world_per_voxel; }
  __device__ int lane() const { return lane_; }

 private:
  __device__ float DensityAt(const Cell<float>& cell) const {
    const int stride_y = grid_.frame.resolution.z;
    const int stride_x = grid_.frame.resolution.y * stride_y;
    const float* d = grid_.dense_density + cell.vertex;
    const Vec3f& f = cell.fraction;
    const auto along_z = [&](int offset) {
      return d[offset] * (1 - f.z) + d[offset + 1] * f.z;
    };
    const float x0 = along_z(0) * (1 - f.y) + along_z(stride_y) * f.y;
    const float x1 = along_z(stride_x) * (1 - f.y) + along_z(stride_x + stride_y) * f.y;
    return x0 * (1 - f.x) + x1 * f.x;
  }

  const DeviceGridView& grid_;
  const MarchOptions& options_;
  GridRay<float> ray_;
  int lane_;
  float delta_ = 0;
  int64_t step_ = 0;
  float depth_ = 0;  // optical depth of what has been composited
  bool stopped_ = false;
};

}  // namespace regrade

#endif
