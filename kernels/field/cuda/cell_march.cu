#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cell_walk.h"
#include "kernels/field/cuda/cell_march.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

CellSampleStore::CellSampleStore(const GridFrame& frame, int64_t rays, int64_t max_bytes) {
  const Vec3i& n = frame.resolution;
  capacity_ = static_cast<int>(std::min<int64_t>(int64_t{n.x} + n.y + n.z, kMostCellSamples));
  constexpr int64_t kBytes = 3 * sizeof(float) * 4;
  const int64_t fitting = std::clamp<int64_t>(max_bytes / (kBytes * capacity_), 1, rays);
  place_ = DeviceBuffer<float>(4 * fitting * capacity_, "samples of rays");
  raw_tau_ = DeviceBuffer<float>(4 * fitting * capacity_, "samples of rays");
  rest_ = DeviceBuffer<float>(4 * fitting * capacity_, "samples of rays");
  transmittance_ = DeviceBuffer<float>(fitting, "transmittances of rays");
  count_ = DeviceBuffer<int32_t>(fitting, "numbers of samples");
}

CellSamples CellSampleStore::view() {
  return {place_.data(), raw_tau_.data(),       rest_.data(),
          count_.data(), transmittance_.data(), capacity_};
}

#if defined(__CUDACC__)

namespace {

__global__ void MarchCellsKernel(DeviceGridView grid, const Ray* rays, int64_t n, float stop,
                                 CellSamples out) {
  const int64_t r = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (r >= n) return;
  const int64_t begin = r * out.capacity;
  float4* const place = reinterpret_cast<float4*>(out.place) + begin;
  float4* const raw_tau = reinterpret_cast<float4*>(out.raw_tau) + begin;
  float4* const rest = reinterpret_cast<float4*>(out.rest) + begin;
  int count = 0;
  float depth = 0, transmittance = 1;
  WalkCells(grid.frame, grid.cells, rays[r], grid.near_clip, [&](const CellSample<float>& s) {
    if (s.cell == kNoCell) return true;
    const int4* corner = reinterpret_cast<const int4*>(grid.cells.corner + int64_t{8} * s.cell);
    const int4 low = corner[0], high = corner[1];
    const float* density = grid.dense_density;
    const float z1 = s.fraction.z, z0 = 1 - z1, y1 = s.fraction.y, y0 = 1 - y1;
    const float x0 = (density[low.x] * z0 + density[low.y] * z1) * y0 +
                     (density[low.z] * z0 + density[low.w] * z1) * y1;
    const float x1 = (density[high.x] * z0 + density[high.y] * z1) * y0 +
                     (density[high.z] * z0 + density[high.w] * z1) * y1;
    const float tau = OpticalDepth(x0 * (1 - s.fraction.x) + x1 * s.fraction.x, s.delta);
    if (!(tau > 0)) return true;
    place[count] = {__int_as_float(8 * s.cell), s.fraction.x, s.fraction.y, s.fraction.z};
    raw_tau[count].w = tau;
    rest[count] = {transmittance, s.delta, s.t, 0};
    ++count;
    depth += tau;
    transmittance = expf(-depth);
    return !(transmittance < stop) && count < out.capacity;
  });
  out.count[r] = count;
  out.transmittance[r] = transmittance;
}

}  // namespace

void MarchCellsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, const CellSamples& samples) {
  if (n == 0) return;
  constexpr int kBlock = 64;  // rays differ in length
  MarchCellsKernel<<<static_cast<unsigned>((n + kBlock - 1) / kBlock), kBlock>>>(
      grid.view(), rays, n, options.stop_transmittance, samples);
  CheckLaunch("march_cells");
}

#else

void MarchCellsOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                        const CellSamples&) {
  DeviceWait("march_cells");
}

#endif

}  // namespace regrade
