// Rendering, one warp per ray at a time.
#include <algorithm>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/ray_shaders.h"
#include "kernels/field/cuda/warp_layers.h"
#include "kernels/field/resolve_pixel.h"
#include "kernels/scene/pinhole_rays.h"

namespace regrade {

RenderedView RenderViewOnDevice(const DeviceGrid& grid, const Camera& camera,
                                const MarchOptions& options, float opacity_step,
                                const HalfGrid* half) {
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
    RenderFrameOnDevice(grid, camera, options, target, opacity_step, half);
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
  RenderOnDevice(grid, device_rays.data(), n, options, target, opacity_step);
  take();
  FinishView(camera, rays, &view);
  return view;
}

#if defined(__CUDACC__)

namespace {

constexpr int kWarps = 4;     // per block
constexpr int kRays = 8;      // per block; 16 are as fast, 32 lose what neighbours share
constexpr int kPending = 64;  // samples waiting to be shaded; a power of 2

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

// Rays from a list; sums are stored unchanged. A block processes kRays of them.
struct ListedRays {
  const Ray* rays;
  int64_t n;

  // The index-th ray and the index of its results; false past the last.
  __device__ bool Get(int64_t index, Ray* ray, int64_t* place) const {
    *place = index;
    if (index >= n) return false;
    *ray = rays[*place];
    return true;
  }
  __device__ void Resolve(const Ray&, float, Vec3f*, float*) const {}
  int64_t Blocks() const { return (n + kRays - 1) / kRays; }
};

// The rays of a frame. Concurrent warps process neighbouring pixels, which read the same
// voxels: square tiles one after the other, Morton order within each.
struct FrameRays {
  static constexpr int kTile = 16, kPixels = kTile * kTile;
  PinholeRays camera;
  ResolvePixel resolve;

  HD int Columns() const { return (camera.width + kTile - 1) / kTile; }
  __device__ bool Get(int64_t index, Ray* ray, int64_t* place) const {
    const int tile = static_cast<int>(index / kPixels);
    int x = tile % Columns() * kTile, y = tile / Columns() * kTile;
#pragma unroll
    for (int bit = 0; bit < 4; ++bit) {
      x += static_cast<int>(index >> (2 * bit) & 1) << bit;
      y += static_cast<int>(index >> (2 * bit + 1) & 1) << bit;
    }
    if (x >= camera.width || y >= camera.height) return false;
    *ray = camera.At(x, y);
    *place = int64_t{y} * camera.width + x;
    return true;
  }
  __device__ void Resolve(const Ray& ray, float transmittance, Vec3f* color,
                          float* depth) const {
    resolve(ray, transmittance, color, depth);
  }
  int64_t Blocks() const {
    return int64_t{Columns()} * ((camera.height + kTile - 1) / kTile) * (kPixels / kRays);
  }
};

// A ray prepared by one thread of the block for a warp.
struct PreparedRay {
  GridRay<float> ray;
  float basis[kMaxBasis];
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

// Continues behind the box for a field with layers; one warp per ray.
template <typename Rays>
__global__ void RenderSpheresKernel(DeviceGridView grid, Rays rays, float stop,
                                    DeviceRenderTarget target) {
  Ray ray;
  int64_t place;
  if (!rays.Get((blockIdx.x * int64_t{blockDim.x} + threadIdx.x) / 32, &ray, &place)) return;
  WarpLayers layers(grid, ray, target.transmittance[place], stop);
  LaneLayer mine;
  unsigned composited;
  Vec3f color{};
  float depth = 0;
  while (layers.Next(&mine, &composited)) {
    if (!(mine.tau > 0)) continue;
    const float w = mine.Weight();
    color += mine.Color() * w;
    depth += w * mine.depth;
  }
  for (int c = 0; c < 3; ++c) color[c] = WarpSum(color[c]);
  depth = target.depth[place] + WarpSum(depth);
  if (layers.lane() != 0) return;
  const float transmittance = layers.transmittance();
  color += target.color[place] + grid.background * transmittance;
  rays.Resolve(ray, transmittance, &color, &depth);
  target.color[place] = color;
  target.depth[place] = depth;
  target.transmittance[place] = transmittance;
}

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

// Every sample is shaded.
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

void RenderCellFrame(const DeviceGrid& grid, const FrameRays& frame,
                     const MarchOptions& options, const DeviceRenderTarget& target) {
  const int64_t n = frame.Blocks() * kRays;
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
  if (grid.cells.on())
    RenderCellRays(grid, rays, n, options, target);
  else
    RenderBlocks(grid, nullptr, ListedRays{rays, n}, options, opacity_step, target);
}

void RenderFrameOnDevice(const DeviceGrid& grid, const Camera& camera,
                         const MarchOptions& options, const DeviceRenderTarget& target,
                         float opacity_step, const HalfGrid* half) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole);
  const DeviceRange range("frame");
  const FrameRays rays{PinholeRays(camera), ResolvePixel(camera)};
  if (grid.cells.on())
    RenderCellFrame(grid, rays, options, target);
  else
    RenderBlocks(grid, half, rays, options, opacity_step, target);
}

#else

void RenderOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&, float) {
  DeviceWait("render_rays");
}
void RenderFrameOnDevice(const DeviceGrid&, const Camera&, const MarchOptions&,
                         const DeviceRenderTarget&, float, const HalfGrid*) {
  DeviceWait("render_rays");
}

#endif

}  // namespace regrade
