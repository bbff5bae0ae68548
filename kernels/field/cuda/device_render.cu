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
                                const MarchOptions& options, const FastFrames& fast) {
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
    RenderFrameOnDevice(grid, camera, options, target, fast);
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
  RenderOnDevice(grid, device_rays.data(), n, options, target, fast.opacity_step);
  take();
  FinishView(camera, rays, &view);
  return view;
}

#if defined(__CUDACC__)

namespace {

constexpr int kWarps = 4;             // per block
constexpr int kRays = kRenderedRays;  // per block
constexpr int kPending = 64;          // samples waiting to be shaded; a power of 2

// Selects the samples to shade and their weights; see EQ(opacity-steps).
class OpacitySteps {
 public:
  __device__ explicit OpacitySteps(float step) : inverse_(step > 0 ? 1 / step : 0) {}

  // `before` and `after`: transmittances around a compositing lane's sample. Selected lanes get
  // a weight above 0.
  __device__ unsigned Choose(bool composites, float before, float after, int lane,
                             float* weight) {
    const bool chosen = composites && (inverse_ == 0 || Steps(after) > Steps(before));
    const unsigned all = __ballot_sync(kAllLanes, chosen);
    const unsigned earlier = all & ((1u << lane) - 1);
    const float last_of_batch =
        __shfl_sync(kAllLanes, after, earlier == 0 ? 0 : 31 - __clz(earlier));
    *weight = chosen ? (earlier == 0 ? shaded_ : last_of_batch) - after : 0.0f;
    if (all != 0) shaded_ = __shfl_sync(kAllLanes, after, 31 - __clz(all));
    return all;
  }
  // Normalises the sum of the weights to 1 - transmittance at the ray's end.
  __device__ float Scale(float transmittance) const {
    return shaded_ < 1 ? (1 - transmittance) / (1 - shaded_) : 1.0f;
  }

 private:
  // 2^23 + round((1 - transmittance) / step); see LocateCellIn.
  __device__ float Steps(float transmittance) const {
    return __fadd_rd((1 - transmittance) * inverse_ + 0.5f, 8388608.0f);
  }

  float inverse_;
  float shaded_ = 1;  // transmittance after the last selected sample
};

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

template <typename Shader, typename View>
__device__ RaySums MarchRay(const View& grid, const PreparedRay& prepared,
                            const MarchOptions& options, float opacity_step,
                            PendingSamples* pending) {
  constexpr int kSamples = 32 / Shader::kGroup;
  const int lane = static_cast<int>(threadIdx.x & 31);
  Shader shader(grid, prepared.basis, lane);
  WarpMarch<typename Shader::Sampler> march(shader.sampler(), prepared.ray, options);
  LaneSample sample;
  unsigned composited;
  float depth = 0;
  OpacitySteps steps(opacity_step);
  int arrived = 0, shaded = 0;
  const auto shade = [&] {
    const int mine = shaded + lane / Shader::kGroup;
    const bool valid = mine < arrived;
    const float4 at = pending->place[mine % kPending];
    shader.Add(valid ? __float_as_int(at.x) : 0, {at.y, at.z, at.w}, valid,
               valid ? pending->weight[mine % kPending] : 0.0f);
    shaded += kSamples;
  };
  while (march.Next(&sample, &composited)) {
    const float alpha = sample.tau > 0 ? Shader::Sampler::Alpha(sample.tau) : 0.0f;
    const float w = sample.transmittance_before * alpha;
    depth += w * sample.t;
    float seen;
    const unsigned chosen = steps.Choose(sample.tau > 0, sample.transmittance_before,
                                         sample.transmittance_before - w, lane, &seen);
    if (chosen == 0) continue;
    if (chosen >> lane & 1) {
      const int at = (arrived + __popc(chosen & ((1u << lane) - 1))) % kPending;
      const Vec3f& f = sample.cell.fraction;
      pending->place[at] = {__int_as_float(sample.cell.vertex), f.x, f.y, f.z};
      pending->weight[at] = opacity_step > 0 ? seen : w;
    }
    arrived += __popc(chosen);
    __syncwarp();  // written by some lanes, read by others
    while (arrived - shaded >= kSamples) shade();
    __syncwarp();  // all reads precede the next writes
  }
  if (arrived > shaded) shade();
  __syncwarp();
  const float transmittance = expf(-march.optical_depth());
  const float scale = opacity_step > 0 ? steps.Scale(transmittance) : 1.0f;
  return {shader.Sum() * scale + grid.background * transmittance,
          WarpSum(depth) * march.world_per_voxel(), transmittance};
}

template <typename Shader, int kBasis, typename View, typename Rays>
__global__ void __launch_bounds__(32 * kWarps, 5)
    RenderRaysKernel(View grid, Rays rays, MarchOptions options, float opacity_step,
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
    const RaySums result =
        MarchRay<Shader>(grid, prepared[i], options, opacity_step, &pending[warp]);
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
void RenderBlocks(const DeviceGrid& grid, const HalfGrid* half, const Rays& rays,
                  const MarchOptions& options, float opacity_step,
                  const DeviceRenderTarget& target) {
  const auto blocks = static_cast<unsigned>(rays.Blocks());
  if (blocks == 0) return;
  const bool resolve = !grid.spheres.on();
  const auto render = [&](auto view, auto launch) {
    if (!resolve) view.background = {};  // the layers are composited before it
    launch(view);
    CheckLaunch("render_rays");
  };
  if (half != nullptr && !half->empty()) {
    render(half->view(grid), [&](const HalfGridView& view) {
      RenderRaysKernel<HalfShader, 9>
          <<<blocks, 32 * kWarps>>>(view, rays, options, opacity_step, target, resolve);
    });
  } else {
    ByBasis(grid.basis, [&](auto basis) {
      render(grid.view(), [&](const DeviceGridView& view) {
        RenderRaysKernel<FloatShader<basis.value>, basis.value>
            <<<blocks, 32 * kWarps>>>(view, rays, options, opacity_step, target, resolve);
      });
    });
  }
  if (resolve) return;
  RenderSpheresKernel<<<BlocksFor(int64_t{32} * kRays * blocks), kThreads>>>(
      grid.view(), rays, options.stop_transmittance, target);
  CheckLaunch("render_spheres");
}

}  // namespace

void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target,
                    float opacity_step) {
  RenderBlocks(grid, nullptr, ListedRays{rays, n}, options, opacity_step, target);
}

void RenderFrameOnDevice(const DeviceGrid& grid, const Camera& camera,
                         const MarchOptions& options, const DeviceRenderTarget& target,
                         const FastFrames& fast) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole);
  const DeviceRange range("frame");
  RenderBlocks(grid, fast.half, FrameRays{PinholeRays(camera), ResolvePixel(camera)}, options,
               fast.opacity_step, target);
}

#else

void RenderOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&, float) {
  DeviceWait("render_rays");
}
void RenderFrameOnDevice(const DeviceGrid&, const Camera&, const MarchOptions&,
                         const DeviceRenderTarget&, const FastFrames&) {
  DeviceWait("render_rays");
}

#endif

}  // namespace regrade
