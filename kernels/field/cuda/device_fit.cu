// The forward pass, loss and adjoint of fitting, one warp per ray.
#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_sphere_rays.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_adjoint_scan.h"
#include "kernels/field/cuda/warp_shade.h"

namespace regrade {

DeviceTouched::DeviceTouched(const DeviceGrid& grid)
    : num_voxels(grid.num_voxels()),
      num_points(grid.num_points()),
      bits((grid.num_points() + 31) / 32, "marks of touched voxels") {
  bits.Zero();
}

void DeviceTouched::MarkAll() {
  std::vector<uint32_t> all(static_cast<size_t>(bits.size()), ~uint32_t{0});
  const auto end_at = [&all](int64_t end) {
    if (end % 32 != 0) all[static_cast<size_t>(end / 32)] = (uint32_t{1} << (end % 32)) - 1;
  };
  end_at(num_voxels);
  end_at(num_points);
  bits.CopyIn(all.data(), bits.size());
}

#if defined(__CUDACC__)

namespace {

constexpr int kFloatsPerSample = 9;
constexpr int kWarpsPerBlock = 4;

// A ray's composited samples, front to back, stored for the adjoint: [capacity] of each.
struct SampleStore {
  float4* place;    // vertex (as bits), fraction
  float4* raw_tau;  // colour before the clamp, optical depth
  float* before;    // transmittance before
};

// Adds the gradients of `count` samples, the i-th of them held by lane i, to the corners'
// records: d / d value = sum_c of[c] d_raw[c] + density d_sigma.
template <int kBasis, bool kExact>
__device__ void ScatterChunk(const DeviceGridView& grid, const LaneValues<kBasis>& values,
                             const float4& place, const Vec3f& d_raw, float d_sigma, int count,
                             const GradientView& gradient, int lane) {
  using Layout = RecordLayout<kBasis>;
  float* mine = gradient.gradient + lane % Layout::kGroup * Layout::kValues;
  for (int s = 0; s < count; s += Layout::kSamples) {
    const int source = s + lane / Layout::kGroup, from = source & 31;
    const bool valid = source < count;
    const int vertex = __shfl_sync(kAllLanes, __float_as_int(place.x), from);
    const Vec3f fraction{__shfl_sync(kAllLanes, place.y, from),
                         __shfl_sync(kAllLanes, place.z, from),
                         __shfl_sync(kAllLanes, place.w, from)};
    const Vec3f d{__shfl_sync(kAllLanes, d_raw.x, from), __shfl_sync(kAllLanes, d_raw.y, from),
                  __shfl_sync(kAllLanes, d_raw.z, from)};
    const float d_density = __shfl_sync(kAllLanes, d_sigma, from);
    float own[Layout::kValues];
#pragma unroll
    for (int i = 0; i < Layout::kValues; ++i)
      own[i] = values.of[0][i] * d.x + values.of[1][i] * d.y + values.of[2][i] * d.z +
               values.density[i] * d_density;
    const GroupLinks<Layout::kGroup> links(GridSampler(grid), vertex, valid, lane);
    links.ForEachOwn([&](int32_t link) { Touch(gradient.touched, link); });
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      const int32_t link = links.Of(k);
      if (link < 0) continue;
      const float weight = CornerWeight(fraction, k);
      if constexpr (kExact) {
        const int first = lane % Layout::kGroup * Layout::kValues;
        for (int i = 0; i < Layout::kValues; ++i)
          AddExact(gradient.gradient + link * grid.stride, first + i, weight * own[i]);
      } else {
        AddQuad(mine + link * grid.stride,
                {weight * own[0], weight * own[1], weight * own[2], weight * own[3]});
      }
    }
  }
}

// The backward pass along a ray; see EQ(composite-adjoint). `behind` is the radiance behind all
// samples, `remaining` the transmittance there.
template <int kBasis, bool kExact>
__device__ void WalkBack(const DeviceGridView& grid, const LaneValues<kBasis>& values,
                         const SampleStore& store, int count, float delta, Vec3f behind,
                         const Vec3f& d_color, const DensityLosses& losses, float remaining,
                         const GradientView& gradient, int lane) {
  for (int end = count; end > 0; end -= 32) {
    const int mine = end - 1 - lane;
    float a = 1, d_sigma = 0;
    Vec3f b{}, d_raw{};
    float4 place = {};
    Vec3f color{};
    float before = 0, tau = 0;
    if (mine >= 0) {
      place = store.place[mine];
      const float4 raw_tau = store.raw_tau[mine];
      before = store.before[mine];
      tau = raw_tau.w;
      a = expf(-tau);
      color = {fmaxf(raw_tau.x, 0.0f), fmaxf(raw_tau.y, 0.0f), fmaxf(raw_tau.z, 0.0f)};
      const float alpha = Opacity(tau);
      b = color * alpha;
      const float w = before * alpha;
      d_raw = {raw_tau.x > 0 ? w * d_color.x : 0.0f, raw_tau.y > 0 ? w * d_color.y : 0.0f,
               raw_tau.z > 0 ? w * d_color.z : 0.0f};
    }
    const Vec3f radiance_behind = BackgroundRadiance(a, b, lane, &behind);
    if (mine >= 0 && tau < static_cast<float>(kMaxOpticalDepth)) {
      d_sigma = delta * before * a * Dot(color - radiance_behind, d_color);
      if (losses.on() && delta > 0)
        d_sigma += DensityLossSlope(losses, remaining, tau / delta, delta);
    }
    ScatterChunk<kBasis, kExact>(grid, values, place, d_raw, d_sigma, min(32, end), gradient,
                                 lane);
    __syncwarp();
  }
}

// Shades the samples of a ray that wait in a store from `shaded` on, one per group of lanes.
// Adds to lanes' sums.
template <int kBasis>
__device__ void ShadeStored(const DeviceGridView& grid, const LaneValues<kBasis>& values,
                            const SampleStore& store, int shaded, int count, int lane,
                            Vec3f* color) {
  using Layout = RecordLayout<kBasis>;
  const int at = shaded + lane / Layout::kGroup;
  const bool valid = at < count;
  const float4 place = valid ? store.place[at] : float4{};
  const Vec3f raw =
      RawColor(grid, values, __float_as_int(place.x), {place.y, place.z, place.w}, valid, lane);
  if (!valid || lane % Layout::kGroup != 0) return;
  const float tau = store.raw_tau[at].w, w = store.before[at] * Opacity(tau);
  store.raw_tau[at] = {raw.x, raw.y, raw.z, tau};
  for (int c = 0; c < 3; ++c) (*color)[c] += w * fmaxf(raw[c], 0.0f);
}

// The loss of a ray and what its adjoint needs, from the sums of the lanes' colours.
struct RayLoss {
  Vec3f behind, error;

  __device__ RayLoss(const DeviceGridView& grid, const Vec3f& color, float transmittance,
                     const Vec3f& target, int64_t ray, float stop, float scale,
                     const Vec3f* behind_rays, Vec3f* d_behind_rays, int lane) {
    const bool sees_layers = behind_rays != nullptr && transmittance >= stop;
    behind = sees_layers ? behind_rays[ray] : grid.background;
    for (int c = 0; c < 3; ++c)
      error[c] = WarpSum(color[c]) + behind[c] * transmittance - target[c];
    if (d_behind_rays != nullptr && lane == 0)
      d_behind_rays[ray] = error * (sees_layers ? 2 * scale * transmittance : 0.0f);
  }
};

template <int kBasis, bool kExact>
__global__ void FitRaysKernel(DeviceGridView grid, const Ray* rays, const Vec3f* targets, int n,
                              MarchOptions options, float scale, DensityLosses losses,
                              GradientView gradient, float* store_memory, int64_t capacity,
                              int32_t* next_ray, const Vec3f* behind_rays, Vec3f* d_behind_rays,
                              DeviceFitSums* sums) {
  using Layout = RecordLayout<kBasis>;
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int64_t warp = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  float* mine = store_memory + warp * capacity * kFloatsPerSample;
  const SampleStore store{reinterpret_cast<float4*>(mine),
                          reinterpret_cast<float4*>(mine + 4 * capacity), mine + 8 * capacity};
  double squared_error = 0;
  unsigned long long samples = 0;
  for (;;) {
    int r = 0;
    if (lane == 0) r = atomicAdd(next_ray, 1);
    r = __shfl_sync(kAllLanes, r, 0);
    if (r >= n) break;
    const Ray ray = rays[r];
    float basis[kMaxVoxelBasis];
    ShBasis(kBasis, ray.direction, basis);
    const LaneValues<kBasis> values(lane, basis);
    WarpMarch<> march(grid, ray, options);
    LaneSample sample;
    unsigned composited;
    Vec3f color{};
    int count = 0, shaded = 0;
    const auto shade = [&] {
      ShadeStored(grid, values, store, shaded, count, lane, &color);
      shaded += Layout::kSamples;
    };
    while (march.Next(&sample, &composited)) {
      if (sample.tau > 0) {
        const int at = count + __popc(composited & ((1u << lane) - 1));
        const Vec3f& f = sample.cell.fraction;
        store.place[at] = {__int_as_float(sample.cell.vertex), f.x, f.y, f.z};
        store.raw_tau[at].w = sample.tau;
        store.before[at] = sample.transmittance_before;
      }
      count += __popc(composited);
      __syncwarp();  // written by some lanes, read by others
      while (count - shaded >= Layout::kSamples) shade();
    }
    if (count > shaded) shade();
    const float transmittance = expf(-march.optical_depth());
    const RayLoss loss(grid, color, transmittance, targets[r], r, options.stop_transmittance,
                       scale, behind_rays, d_behind_rays, lane);
    squared_error += ExactTerm(static_cast<double>(Dot(loss.error, loss.error)));
    samples += static_cast<unsigned>(count);
    __syncwarp();  // colours were written by some lanes and are read by others
    WalkBack<kBasis, kExact>(grid, values, store, count, march.delta(), loss.behind,
                             loss.error * (2 * scale), losses, transmittance, gradient, lane);
  }
  if (lane == 0) {
    atomicAdd(&sums->squared_error, squared_error);
    atomicAdd(&sums->samples, samples);
  }
}

}  // namespace

DeviceRayFitter::DeviceRayFitter(const GridFrame& frame, const MarchOptions& options,
                                 int64_t max_bytes)
    : options_(options), next_ray_(1, "a counter of rays"), sums_(1, "sums of a fit") {
  sums_.Zero();
  const Vec3f n = frame.resolution.Cast<float>();
  // The longest path through the box; a multiple of 4 aligns the parts of a store.
  capacity_ = (static_cast<int64_t>(Norm(n) / options.step) + 8) / 4 * 4;
  const int64_t bytes_a_warp =
      capacity_ * kFloatsPerSample * static_cast<int64_t>(sizeof(float));
  const int64_t wanted = static_cast<int64_t>(ReadDeviceStatus().multiprocessors) * 32;
  const int64_t fitting = std::min(wanted, max_bytes / bytes_a_warp);
  warps_ = static_cast<int>(std::max<int64_t>(fitting / kWarpsPerBlock, 1)) * kWarpsPerBlock;
  store_ =
      DeviceBuffer<float>(warps_ * capacity_ * kFloatsPerSample, "samples of rays in flight");
}

void DeviceRayFitter::Accumulate(const DeviceGrid& grid, const Ray* rays, const Vec3f* targets,
                                 int64_t n, float scale, DeviceTouched* touched,
                                 const DensityLosses& losses) {
  next_ray_.Zero();
  REGRADE_CHECK(grid.fitting);
  const GradientView view{grid.gradient(), touched->bits.data()};
  const bool spheres = grid.spheres.on();
  if (spheres) {
    if (behind_.size() < n) {
      behind_ = DeviceBuffer<Vec3f>(n, "radiance behind the box");
      d_behind_ = DeviceBuffer<Vec3f>(n, "gradients of the radiance behind the box");
    }
    SphereRadiance(grid, rays, n, options_, behind_.data());
  }
  ByBasis(grid.basis, grid.exact_sums, [&](auto basis, auto exact) {
    FitRaysKernel<basis.value, exact.value>
        <<<static_cast<unsigned>(warps_ / kWarpsPerBlock), 32 * kWarpsPerBlock>>>(
            grid.view(), rays, targets, static_cast<int>(n), options_, scale, losses, view,
            store_.data(), capacity_, next_ray_.data(), spheres ? behind_.data() : nullptr,
            spheres ? d_behind_.data() : nullptr, sums_.data());
  });
  CheckLaunch("fit_rays");
  if (spheres)
    SphereRadianceAdjoint(grid, rays, d_behind_.data(), n, options_, touched, sums_.data());
}

DeviceFitSums DeviceRayFitter::TakeSums() {
  DeviceFitSums sums;
  sums_.CopyOut(&sums, 1);
  sums_.Zero();
  return sums;
}

#else

DeviceRayFitter::DeviceRayFitter(const GridFrame&, const MarchOptions&, int64_t) {
  DeviceWait("fit_rays");
}
void DeviceRayFitter::Accumulate(const DeviceGrid&, const Ray*, const Vec3f*, int64_t, float,
                                 DeviceTouched*, const DensityLosses&) {}
DeviceFitSums DeviceRayFitter::TakeSums() { return {}; }

#endif

}  // namespace regrade
