// Rendering of adaptive fields: samples of many rays are listed, then shaded, a warp a ray.
#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_cell_render.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/rendered_rays.h"
#include "kernels/field/cuda/warp_shade.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// Sums of an adaptive field's rays, whose samples are in lists; a warp a ray.
template <int kBasis>
__global__ void RenderCellRaysKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                     CellSamples lists, DeviceRenderTarget target) {
  using Layout = RecordLayout<kBasis>;
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  const float4* const place = reinterpret_cast<const float4*>(lists.place) + r * lists.capacity;
  const float4* const raw_tau =
      reinterpret_cast<const float4*>(lists.raw_tau) + r * lists.capacity;
  const float4* const rest = reinterpret_cast<const float4*>(lists.rest) + r * lists.capacity;
  float basis[kMaxBasis];
  ShBasis(kBasis, rays[r].direction, basis);
  const LaneValues<kBasis> values(lane, basis);
  const int count = lists.count[r];
  Vec3f color{};
  float depth = 0;
  for (int first = 0; first < count; first += Layout::kSamples) {
    const int at = first + lane / Layout::kGroup;
    const bool valid = at < count;
    const float4 p = valid ? place[at] : float4{};
    const Vec3f raw = RawColor<kBasis, CellSampler>(grid, values, __float_as_int(p.x),
                                                    {p.y, p.z, p.w}, valid, lane);
    if (!valid || lane % Layout::kGroup != 0) continue;
    const float w = rest[at].x * Opacity(raw_tau[at].w);
    for (int c = 0; c < 3; ++c) color[c] += w * fmaxf(raw[c], 0.0f);
    depth += w * rest[at].z;
  }
  for (int c = 0; c < 3; ++c) color[c] = WarpSum(color[c]);
  depth = WarpSum(depth);
  if (lane != 0) return;
  target.color[r] = color + grid.background * lists.transmittance[r];
  target.depth[r] = depth;
  target.transmittance[r] = lists.transmittance[r];
}

// Lists a frame's rays in their order; those beyond its border have no direction, and so no
// samples.
__global__ void ListRaysKernel(FrameRays frame, int64_t n, Ray* rays) {
  const int64_t i = blockIdx.x * int64_t{blockDim.x} + threadIdx.x;
  int64_t place;
  if (i < n && !frame.Get(i, &rays[i], &place)) rays[i] = Ray{};
}
__global__ void ResolveFrameKernel(FrameRays frame, int64_t n, DeviceRenderTarget listed,
                                   DeviceRenderTarget target) {
  const int64_t i = blockIdx.x * int64_t{blockDim.x} + threadIdx.x;
  Ray ray;
  int64_t place;
  if (i >= n || !frame.Get(i, &ray, &place)) return;
  Vec3f color = listed.color[i];
  float depth = listed.depth[i];
  frame.Resolve(ray, listed.transmittance[i], &color, &depth);
  target.color[place] = color;
  target.depth[place] = depth;
  target.transmittance[place] = listed.transmittance[i];
}

}  // namespace

void RenderCellRays(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target) {
  constexpr int64_t kMostRays = 1 << 16, kMostBytes = int64_t{2} << 30;
  CellSampleStore store(grid.frame, std::min(n, kMostRays), kMostBytes);
  const CellSamples lists = store.view();
  DeviceGridView view = grid.view();
  if (grid.spheres.on()) view.background = {};  // the layers are composited before it
  for (int64_t begin = 0; begin < n; begin += store.rays()) {
    const int64_t size = std::min(n - begin, store.rays());
    MarchCellsOnDevice(grid, rays + begin, size, options, lists);
    ByBasis(grid.basis, [&](auto basis) {
      RenderCellRaysKernel<basis.value><<<BlocksFor(32 * size), kThreads>>>(
          view, rays + begin, size, lists,
          {target.color + begin, target.depth + begin, target.transmittance + begin});
    });
    CheckLaunch("render_cell_rays");
  }
  if (!grid.spheres.on()) return;
  RenderSpheresKernel<<<BlocksFor(32 * n), kThreads>>>(grid.view(), ListedRays{rays, n},
                                                       options.stop_transmittance, target);
  CheckLaunch("render_spheres");
}

void RenderCellFrame(const DeviceGrid& grid, const Camera& camera, const MarchOptions& options,
                     const DeviceRenderTarget& target) {
  const FrameRays frame{PinholeRays(camera), ResolvePixel(camera)};
  const int64_t n = frame.Blocks() * kRenderedRays;
  DeviceBuffer<Ray> rays(n, "rays of a frame");
  DeviceBuffer<Vec3f> color(n, "colours of a frame");
  DeviceBuffer<float> depth(n, "depths of a frame"), transmittance(n, "transmittances");
  ListRaysKernel<<<BlocksFor(n), kThreads>>>(frame, n, rays.data());
  CheckLaunch("list_rays");
  const DeviceRenderTarget listed{color.data(), depth.data(), transmittance.data()};
  RenderCellRays(grid, rays.data(), n, options, listed);
  ResolveFrameKernel<<<BlocksFor(n), kThreads>>>(frame, n, listed, target);
  CheckLaunch("resolve_frame");
}

#else

void RenderCellRays(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&) {
  DeviceWait("render_cell_rays");
}
void RenderCellFrame(const DeviceGrid&, const Camera&, const MarchOptions&,
                     const DeviceRenderTarget&) {
  DeviceWait("render_cell_rays");
}

#endif

}  // namespace regrade
