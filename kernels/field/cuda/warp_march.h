// Marches one ray with one warp, 32 consecutive samples at a time. Device code only.
#pragma once

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

#if defined(__CUDACC__)

namespace regrade {

inline constexpr unsigned kAllLanes = 0xffffffffu;

// Sum over this lane and all lower ones.
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

__device__ inline int WarpMax(int value) {
#if __CUDA_ARCH__ >= 800
  return __reduce_max_sync(kAllLanes, value);
#else
#pragma unroll
  for (int d = 16; d > 0; d /= 2) value = max(value, __shfl_xor_sync(kAllLanes, value, d));
  return value;
#endif
}

// Per-lane sample state.
struct LaneSample {
  Cell<float> cell;
  float t = 0;    // voxels along the ray
  float tau = 0;  // optical depth; 0 if the sample does not composite
  float transmittance_before = 0;
};

// Array offsets from a vertex to its neighbours along each axis.
struct NeighbourSteps {
  int x, y, z;
  __device__ int To(int corner) const {
    return (corner >> 2 & 1) * x + (corner >> 1 & 1) * y + (corner & 1) * z;
  }
};

// Samples the grid's own arrays during a march.
class GridSampler {
 public:
  __device__ explicit GridSampler(const DeviceGridView& grid) : grid_(grid) {}
  __device__ const Vec3f& last() const { return grid_.last; }
  __device__ int Index(int x, int y, int z) const {
    return (x * grid_.frame.resolution.y + y) * grid_.frame.resolution.z + z;
  }
  __device__ NeighbourSteps Steps(int) const {
    return {grid_.frame.resolution.y * grid_.frame.resolution.z, grid_.frame.resolution.z, 1};
  }
  __device__ int Distance(int vertex) const { return grid_.empty_distance[vertex]; }
  __device__ int32_t Link(int vertex) const { return grid_.links[vertex]; }
  __device__ static float Exp(float x) { return expf(x); }
  __device__ static float Alpha(float tau) { return Opacity(tau); }
  // Interpolated between a vertex and its neighbour along z.
  __device__ float DensityBetween(int vertex, float fraction) const {
    const float* d = grid_.dense_density + vertex;
    return d[0] * (1 - fraction) + d[1] * fraction;
  }

 private:
  const DeviceGridView& grid_;
};

// LocateCell of trilinear.h, bit for bit, without conversions between integers and floats,
// which are slow on a GPU: adding 2^23 and rounding down leaves the integer in the low bits.
// The cell's vertex is the sampler's index.
template <typename Sampler>
__device__ Cell<float> LocateCellIn(const Sampler& sampler, const Vec3f& p) {
  constexpr float kShift = 8388608.0f;
  Cell<float> cell;
  int base[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float last = sampler.last()[a];
    const float clamped = fminf(fmaxf(p[a], 0.0f), last);  // NaN goes to 0
    const float shifted = fminf(__fadd_rd(clamped, kShift), last - 1 + kShift);
    base[a] = __float_as_int(shifted) & 0x7fffff;
    cell.fraction[a] = clamped - (shifted - kShift);
  }
  cell.vertex = sampler.Index(base[0], base[1], base[2]);
  return cell;
}

// The march of a warp's ray; all lanes hold the same state except for their sample.
template <typename Sampler = GridSampler>
class WarpMarch {
 public:
  __device__ WarpMarch(const Sampler& sampler, const GridRay<float>& ray,
                       const MarchOptions& options)
      : sampler_(sampler),
        options_(options),
        ray_(ray),
        lane_(static_cast<int>(threadIdx.x & 31)),
        num_steps_(static_cast<int>(ray.num_steps)) {
    delta_ = options.step * ray_.world_per_voxel;
  }
  __device__ WarpMarch(const DeviceGridView& grid, const Ray& ray, const MarchOptions& options)
      : WarpMarch(GridSampler(grid), ClipToGrid(grid.frame, ray, grid.near_clip, options.step),
                  options) {}

  // Advances to the next 32 samples of which at least one composites; false at the ray's end.
  // Lanes that composite get sample->tau > 0. They are in the order of the ray and follow those
  // of the previous call. See EQ(composite); the ray ends after the sample that leaves less
  // than stop_transmittance.
  __device__ bool Next(LaneSample* sample, unsigned* composited) {
    while (step_ < num_steps_ && !stopped_) {
      const bool was_in_occupied = in_occupied_;
      const int mine = step_ + lane_;
      const bool in_range = mine < num_steps_;
      sample->t = ray_.t_begin + static_cast<float>(mine) * options_.step;
      int distance = 255;
      float density = 0;
      if (in_range) {
        sample->cell = LocateCellIn(sampler_, ray_.At(sample->t));
        distance = sampler_.Distance(sample->cell.vertex);
        // Occupied space usually continues: do not wait for the distance to load densities.
        if (was_in_occupied) density = DensityAt(sample->cell);
      }
      in_occupied_ = __any_sync(kAllLanes, in_range && distance == 0);
      if (!in_occupied_) {
        // All 32 samples are empty; each lane's distance bounds how far the ray stays empty.
        const int skip =
            in_range
                ? lane_ +
                      max(1, static_cast<int>(static_cast<float>(distance - 1) / options_.step))
                : 32;
        step_ += max(32, WarpMax(skip));
        continue;
      }
      step_ += 32;
      sample->tau = 0;
      if (!was_in_occupied && in_range && distance == 0) density = DensityAt(sample->cell);
      if (density > 0) sample->tau = OpticalDepth(density, delta_);
      const float before = depth_ + InclusiveSum(sample->tau, lane_) - sample->tau;
      sample->transmittance_before = Sampler::Exp(-before);
      if (!(sample->transmittance_before >= options_.stop_transmittance)) sample->tau = 0;
      *composited = __ballot_sync(kAllLanes, sample->tau > 0);
      if (*composited == 0) continue;
      const float after = __shfl_sync(kAllLanes, before + sample->tau, 31 - __clz(*composited));
      depth_ = after;
      stopped_ = !(Sampler::Exp(-after) >= options_.stop_transmittance);
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
    const NeighbourSteps steps = sampler_.Steps(cell.vertex);
    const Vec3f& f = cell.fraction;
    const auto along_z = [&](int vertex) { return sampler_.DensityBetween(vertex, f.z); };
    const float x0 = along_z(cell.vertex) * (1 - f.y) + along_z(cell.vertex + steps.y) * f.y;
    const float x1 = along_z(cell.vertex + steps.x) * (1 - f.y) +
                     along_z(cell.vertex + steps.x + steps.y) * f.y;
    return x0 * (1 - f.x) + x1 * f.x;
  }

  Sampler sampler_;
  const MarchOptions& options_;
  GridRay<float> ray_;
  int lane_, num_steps_;  // num_steps_ <= kMaxSteps
  float delta_ = 0;
  int step_ = 0;
  float depth_ = 0;  // optical depth composited so far
  bool in_occupied_ = false, stopped_ = false;
};

}  // namespace regrade

#endif
