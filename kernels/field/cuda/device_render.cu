// Rendering, one warp per ray at a time.
#include <algorithm>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/ray_shaders.h"
#include "kernels/field/cuda/rendered_rays.h"

namespace regrade {

RenderedView RenderViewOnDevice(const DeviceGrid& grid, const Camera& camera,
                                const MarchOptions& options) {
  const int64_t n = int64_t{camera.width} * camera.height;
  DeviceBuffer<Vec3f> color(n, "colours of a view");
  DeviceBuffer<float> depth(n, "depths of a view"),
      transmittance(n, "transmittances of a view");
  const DeviceRenderTarget target{color.data(), depth.data(), transmittance.data()};
  RenderedView view{Image(camera.width, camera.height, 3),
                    Image(camera.width, camera.height, 1),
                    Image(camera.width, camera.height, 1)};
  const auto take = [&] {
    DeviceCopyOut(view.color.pixels.data(), color.data(), n * int64_t{sizeof(Vec3f)});
    depth.CopyOut(view.depth.pixels.data(), n);
    transmittance.CopyOut(view.transmittance.pixels.data(), n);
  };
  if (camera.lens == LensModel::kPinhole) {
    RenderFrameOnDevice(grid, camera, options, target);
    take();
    return view;
  }
  std::vector<Ray> rays(static_cast<size_t>(n));
#pragma omp parallel for schedule(static)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      rays[static_cast<size_t>(y) * camera.width + x] = camera.PixelRay(x, y);
  DeviceBuffer<Ray> device_rays(n, "rays of a view");
  device_rays.CopyIn(rays.data(), n);
  RenderOnDevice(grid, device_rays.data(), n, options, target);
  take();
  FinishView(camera, rays, &view);
  return view;
}

#if defined(__CUDACC__)

namespace {

constexpr int kWarps = 4;             // per block
constexpr int kRays = kRenderedRays;  // per block
constexpr int kPending = 64;          // samples waiting to be shaded; a power of 2

// A ray prepared by one thread of the block for a warp.
struct PreparedRay {
  GridRay<float> ray;
  float basis[kMaxVoxelBasis];
};

// A warp's results for a ray.
struct RaySums {
  Vec3f color;
  float depth, transmittance;
};

// A warp's samples waiting until every group of lanes has one.
struct PendingSamples {
  float4 place[kPending];  // vertex (as bits), fraction
  float weight[kPending];
};

template <int kBasis>
__device__ RaySums MarchRay(const DeviceGridView& grid, const PreparedRay& prepared,
                            const MarchOptions& options, PendingSamples* pending) {
  constexpr int kSamples = 32 / RayShader<kBasis>::kGroup;
  const int lane = static_cast<int>(threadIdx.x & 31);
  RayShader<kBasis> shader(grid, prepared.basis, lane);
  WarpMarch<GridSampler> march(GridSampler(grid), prepared.ray, options);
  LaneSample sample;
  unsigned composited;
  float depth = 0;
  int arrived = 0, shaded = 0;
  const auto shade = [&] {
    const int mine = shaded + lane / RayShader<kBasis>::kGroup;
    const bool valid = mine < arrived;
    const float4 at = pending->place[mine % kPending];
    shader.Add(valid ? __float_as_int(at.x) : 0, {at.y, at.z, at.w}, valid,
               valid ? pending->weight[mine % kPending] : 0.0f);
    shaded += kSamples;
  };
  while (march.Next(&sample, &composited)) {
    const float alpha = sample.tau > 0 ? GridSampler::Alpha(sample.tau) : 0.0f;
    const float w = sample.transmittance_before * alpha;
    depth += w * sample.t;
    const unsigned chosen = __ballot_sync(kAllLanes, sample.tau > 0);
    if (chosen == 0) continue;
    if (sample.tau > 0) {
      const int at = (arrived + __popc(chosen & ((1u << lane) - 1))) % kPending;
      const Vec3f& f = sample.cell.fraction;
      pending->place[at] = {__int_as_float(sample.cell.vertex), f.x, f.y, f.z};
      pending->weight[at] = w;
    }
    arrived += __popc(chosen);
    __syncwarp();  // written by some lanes, read by others
    while (arrived - shaded >= kSamples) shade();
    __syncwarp();  // all reads precede the next writes
  }
  if (arrived > shaded) shade();
  __syncwarp();
  const float transmittance = expf(-march.optical_depth());
  return {shader.Sum() + grid.background * transmittance,
          WarpSum(depth) * march.world_per_voxel(), transmittance};
}

template <int kBasis, typename Rays>
__global__ void __launch_bounds__(32 * kWarps, 5)
    RenderRaysKernel(DeviceGridView grid, Rays rays, MarchOptions options,
                     DeviceRenderTarget target, bool resolve) {
  __shared__ PreparedRay prepared[kRays];
  __shared__ RaySums sums[kRays];
  __shared__ PendingSamples pending[kWarps];
  const int thread = static_cast<int>(threadIdx.x), warp = thread / 32;
  const int64_t index = blockIdx.x * int64_t{kRays} + thread;
  Ray ray;
  int64_t place;
  if (thread < kRays) {
    PreparedRay mine{};
    if (rays.Get(index, &ray, &place)) {
      mine.ray = ClipToGrid(grid.frame, ray, grid.near_clip, options.step);
      ShBasis(kBasis, ray.direction, mine.basis);
    }
    prepared[thread] = mine;
  }
  __syncthreads();
  for (int i = warp; i < kRays; i += kWarps) {
    const RaySums result = MarchRay<kBasis>(grid, prepared[i], options, &pending[warp]);
    if (thread % 32 == 0) sums[i] = result;
  }
  __syncthreads();
  if (thread >= kRays || !rays.Get(index, &ray, &place)) return;
  RaySums mine = sums[thread];
  if (resolve) rays.Resolve(ray, mine.transmittance, &mine.color, &mine.depth);
  target.color[place] = mine.color;
  target.depth[place] = mine.depth;
  target.transmittance[place] = mine.transmittance;
}

template <typename Rays>
void RenderBlocks(const DeviceGrid& grid, const Rays& rays, const MarchOptions& options,
                  const DeviceRenderTarget& target) {
  const auto blocks = static_cast<unsigned>(rays.Blocks());
  if (blocks == 0) return;
  const bool resolve = !grid.spheres.on();
  ByBasis(grid.basis, [&](auto basis) {
    DeviceGridView view = grid.view();
    if (!resolve) view.background = {};  // the layers are composited before it
    RenderRaysKernel<basis.value>
        <<<blocks, 32 * kWarps>>>(view, rays, options, target, resolve);
    CheckLaunch("render_rays");
  });
  if (resolve) return;
  RenderSpheresKernel<<<BlocksFor(int64_t{32} * kRays * blocks), kThreads>>>(
      grid.view(), rays, options.stop_transmittance, target);
  CheckLaunch("render_spheres");
}

}  // namespace

void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target) {
  RenderBlocks(grid, ListedRays{rays, n}, options, target);
}

void RenderFrameOnDevice(const DeviceGrid& grid, const Camera& camera,
                         const MarchOptions& options, const DeviceRenderTarget& target) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole);
  const DeviceRange range("frame");
  RenderBlocks(grid, FrameRays{PinholeRays(camera), ResolvePixel(camera)}, options, target);
}

#else

void RenderOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&) {
  DeviceWait("render_rays");
}
void RenderFrameOnDevice(const DeviceGrid&, const Camera&, const MarchOptions&,
                         const DeviceRenderTarget&) {
  DeviceWait("render_rays");
}

#endif

}  // namespace regrade
