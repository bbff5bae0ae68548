// Colours of rays blended from rows of the points that they touch, and the adjoint; a warp a
// sample.
#include "kernels/device/device_stream.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_shade.h"
#include "stylize/cuda/device_ray_weights.h"
#include "stylize/cuda/warp_item.h"
#include "stylize/cuda/warp_row.h"
#include "stylize/field/view_penalty.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// The point at corner k < 8 of a sample's cell, or -1; see CornerPoints.
__device__ int32_t CornerPoint(const StyleFieldView& grid, const DeviceWeightedSample& sample,
                               int k) {
  if (grid.mean != nullptr) return k == 0 ? sample.vertex : -1;
  if (sample.vertex >= 0)
    return grid.links[sample.vertex + GridSampler(grid).Steps(sample.vertex).To(k)];
  if (k & 1) return -1;
  const int r = grid.spheres.resolution, texel = ~sample.vertex;
  const int layer = texel % grid.spheres.layers, at = texel / grid.spheres.layers;
  const int x = at / r, y = at % r;
  const int east = k & 4 ? (x + 1 < 2 * r ? x + 1 : 0) : x;
  const int south = k & 2 ? min(y + 1, r - 1) : y;
  const int32_t column = grid.spheres.links[int64_t{east} * r + south];
  return column < 0 ? -1 : grid.first_texel() + column * grid.spheres.layers + layer;
}

// What a warp knows of its sample: lanes stand for values of a row, and lane j < 8 for corner
// j.
template <int kBasis>
struct WarpSample {
  using Row = WarpRow<kBasis>;
  DeviceWeightedSample sample;
  int lane;
  int32_t slot;  // of this lane's corner; -1 where nothing is stored
  float corner;  // its trilinear weight
  // The basis functions along the ray of this lane's values, 0 beyond the field's own.
  float gamma[Row::kParts] = {};

  // `rays`: null where gamma is not needed.
  __device__ WarpSample(const StyleFieldView& field, const DeviceWeightedSample& s,
                        const int32_t* slot_of_point, const Ray* rays)
      : sample(s), lane(static_cast<int>(threadIdx.x & 31)), slot(-1), corner(0) {
    const bool splat = field.mean != nullptr;
    if (lane < 8) {
      const int32_t point = CornerPoint(field, sample, lane);
      if (point >= 0) slot = slot_of_point[point];
      corner = splat ? 1.0f : CornerWeight(sample.fraction, lane);
    }
    if (rays == nullptr) return;
    const int basis = sample.vertex < 0 ? 1 : field.basis;  // spheres have plain colours
    float all[kBasis];
    ShBasis(kBasis, splat ? sample.fraction : rays[sample.ray].direction, all);
#pragma unroll
    for (int part = 0; part < Row::kParts; ++part) {
      const int at = lane + 32 * part;
#pragma unroll
      for (int k = 0; k < kBasis; ++k)
        if (at < Row::kSh && at % kBasis == k && k < basis) gamma[part] = all[k];
    }
  }

  // This lane's values of the blended row.
  __device__ void Blend(const float* rows, float (&value)[Row::kParts]) const {
#pragma unroll
    for (int part = 0; part < Row::kParts; ++part) value[part] = 0;
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      const int32_t at = __shfl_sync(kAllLanes, slot, k);
      const float w = __shfl_sync(kAllLanes, corner, k);
      if (at < 0) continue;
#pragma unroll
      for (int part = 0; part < Row::kParts; ++part)
        value[part] += w * rows[int64_t{at} * Row::kStride + lane + 32 * part];
    }
  }
};

// Of values in lane order: sums of a channel's lanes land on its first one.
template <int kBasis>
__device__ float ChannelSums(float value, int lane) {
  static_assert(kBasis == 9 || kBasis == 16);
  const float ninth = __shfl_down_sync(kAllLanes, value, 8);
  if (kBasis == 16 || lane % kBasis == 0) value += ninth;
  value += __shfl_down_sync(kAllLanes, value, 4);
  value += __shfl_down_sync(kAllLanes, value, 2);
  return value + __shfl_down_sync(kAllLanes, value, 1);
}

// Adds to value `at`; integers are twice as wide.
template <bool kExact>
__device__ void AddTo(float* sums, int64_t at, float v) {
  if constexpr (kExact)
    AddExact(sums + 2 * at, 0, v);
  else
    atomicAdd(sums + at, v);
}

// values [n], or the first width * *counted of them, from integers.
__global__ void TakeExactKernel(const float* exact, int64_t n, int width,
                                const int32_t* counted, float* values) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i < n && (counted == nullptr || i < int64_t{*counted} * width))
    values[i] = ExactSum(exact + 2 * i, 0);
}

__global__ void AddBackgroundKernel(Vec3f background, const float* transmittance, int64_t n,
                                    Vec3f* color) {
  const int64_t r = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (r < n) color[r] += background * transmittance[r];
}

template <int kBasis, bool kExact>
__global__ void BlendColorsKernel(StyleFieldView field, const DeviceWeightedSample* samples,
                                  int64_t n, const int32_t* counted,
                                  const int32_t* slot_of_point, const Ray* rays,
                                  const float* rows, float* color, uint8_t* unclamped) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  using Row = WarpRow<kBasis>;
  const WarpSample<kBasis> warp(field, samples[i], slot_of_point, rays);
  float blend[Row::kParts];
  warp.Blend(rows, blend);
  unsigned above[Row::kParts];
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part) {
    const int at = warp.lane + 32 * part;
    const float sum = ChannelSums<kBasis>(blend[part] * warp.gamma[part], warp.lane);
    const float value = 0.5f + sum;  // of a channel on its first lane
    const bool first = at < Row::kSh && at % kBasis == 0;
    if (first && value > 0)
      AddTo<kExact>(color, int64_t{warp.sample.ray} * 3 + at / kBasis,
                    warp.sample.weight * value);
    above[part] = __ballot_sync(kAllLanes, first && value > 0);
  }
  if (warp.lane != 0) return;
  unsigned bits = 0;
#pragma unroll
  for (int c = 0; c < 3; ++c) bits |= (above[c * kBasis / 32] >> c * kBasis % 32 & 1) << c;
  unclamped[i] = static_cast<uint8_t>(bits);
}

template <int kBasis, bool kExact>
__global__ void BlendColorsAdjointKernel(StyleFieldView field,
                                         const DeviceWeightedSample* samples, int64_t n,
                                         const int32_t* counted, const int32_t* slot_of_point,
                                         const Ray* rays, const uint8_t* unclamped,
                                         const Vec3f* d_color, float* d_rows) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const unsigned bits = unclamped[i];
  if (bits == 0) return;
  const Vec3f d = d_color[samples[i].ray];
  if (d.x == 0 && d.y == 0 && d.z == 0) return;
  using Row = WarpRow<kBasis>;
  const WarpSample<kBasis> warp(field, samples[i], slot_of_point, rays);
  float d_blend[Row::kParts] = {};
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part) {
    const int at = warp.lane + 32 * part;
    const bool is_mass = at >= Row::kMass && at < Row::kMass + 3;
    const int c = is_mass ? at - Row::kMass : at / kBasis;
    if (c < 3 && (bits >> c & 1) != 0)
      d_blend[part] =
          warp.sample.weight *
          (is_mass ? static_cast<float>(warp.sample.vertex >= 0) : d[c] * warp.gamma[part]);
  }
#pragma unroll
  for (int k = 0; k < 8; ++k) {
    const int32_t at = __shfl_sync(kAllLanes, warp.slot, k);
    const float w = __shfl_sync(kAllLanes, warp.corner, k);
    if (at < 0) continue;
#pragma unroll
    for (int part = 0; part < Row::kParts; ++part)
      if (d_blend[part] != 0)
        AddTo<kExact>(d_rows, int64_t{at} * Row::kStride + warp.lane + 32 * part,
                      w * d_blend[part]);
  }
}

template <int kBasis, bool kExact>
__global__ void BlendRowsKernel(StyleFieldView field, const DeviceWeightedSample* samples,
                                int64_t n, const int32_t* counted, const int32_t* slot_of_point,
                                const float* rows, float* sums) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  using Row = WarpRow<kBasis>;
  const WarpSample<kBasis> warp(field, samples[i], slot_of_point, nullptr);
  float blend[Row::kParts];
  warp.Blend(rows, blend);
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part)
    AddTo<kExact>(sums, int64_t{warp.sample.ray} * Row::kStride + warp.lane + 32 * part,
                  warp.sample.weight * blend[part]);
}

constexpr int64_t kFloatBytes = sizeof(float);

// What is left of integer sums: values [n], the rows that are counted.
void TakeExact(const float* exact, int64_t n, const NetworkRow& row, const int32_t* counted,
               float* values) {
  TakeExactKernel<<<BlocksFor(n), kThreads, 0, LaunchStream()>>>(exact, n, row.stride(),
                                                                 counted, values);
  CheckLaunch("take_exact");
}

// Calls launch(basis, exact) with the template's arguments.
template <typename Launch>
void ByRowAndSums(const NetworkRow& row, bool exact, const Launch& launch) {
  ByRow(row, [&](auto basis) {
    if (exact)
      launch(basis, std::true_type());
    else
      launch(basis, std::false_type());
  });
}

}  // namespace

void BlendColors(const DeviceStyleField& field, const DeviceRayWeights& weights,
                 const DeviceSlots& slots, const Ray* rays, const float* rows, Vec3f* color,
                 uint8_t* unclamped, float* exact) {
  const int64_t values = 3 * weights.num_rays;
  if (values == 0) return;
  float* const sums = exact != nullptr ? exact : &color->x;
  DeviceZero(sums, (exact != nullptr ? 2 : 1) * values * kFloatBytes);
  if (weights.num_samples > 0) {
    ByRowAndSums(field.row(), exact != nullptr, [&](auto basis, auto in_integers) {
      BlendColorsKernel<basis(), in_integers()>
          <<<BlocksFor(32 * weights.num_samples), kThreads, 0, LaunchStream()>>>(
              field.view(), weights.samples.data(), weights.num_samples, weights.counter.data(),
              slots.slot_of_point.data(), rays, rows, sums, unclamped);
    });
    CheckLaunch("blend_colors");
  }
  if (exact != nullptr) TakeExact(exact, values, field.row(), nullptr, &color->x);
  AddBackgroundKernel<<<BlocksFor(weights.num_rays), kThreads, 0, LaunchStream()>>>(
      field.grid.background, weights.transmittance.data(), weights.num_rays, color);
  CheckLaunch("add_background");
}

void BlendColorsAdjoint(const DeviceStyleField& field, const DeviceRayWeights& weights,
                        const DeviceSlots& slots, const Ray* rays, const uint8_t* unclamped,
                        const Vec3f* d_color, float* d_rows, float* exact) {
  if (weights.num_samples > 0) {
    ByRowAndSums(field.row(), exact != nullptr, [&](auto basis, auto in_integers) {
      BlendColorsAdjointKernel<basis(), in_integers()>
          <<<BlocksFor(32 * weights.num_samples), kThreads, 0, LaunchStream()>>>(
              field.view(), weights.samples.data(), weights.num_samples, weights.counter.data(),
              slots.slot_of_point.data(), rays, unclamped, d_color,
              exact != nullptr ? exact : d_rows);
    });
    CheckLaunch("blend_colors_adjoint");
  }
  if (exact != nullptr && slots.num_slots > 0)
    TakeExact(exact, slots.num_slots * field.row().stride(), field.row(), slots.counter.data(),
              d_rows);
}

void BlendRows(const DeviceStyleField& field, const DeviceRayWeights& weights,
               const DeviceSlots& slots, const float* rows, float* sums, float* exact) {
  const int64_t values = weights.num_rays * field.row().stride();
  if (values == 0) return;
  float* const to = exact != nullptr ? exact : sums;
  DeviceZero(to, (exact != nullptr ? 2 : 1) * values * kFloatBytes);
  if (weights.num_samples > 0) {
    ByRowAndSums(field.row(), exact != nullptr, [&](auto basis, auto in_integers) {
      BlendRowsKernel<basis(), in_integers()>
          <<<BlocksFor(32 * weights.num_samples), kThreads, 0, LaunchStream()>>>(
              field.view(), weights.samples.data(), weights.num_samples, weights.counter.data(),
              slots.slot_of_point.data(), rows, to);
    });
    CheckLaunch("blend_rows");
  }
  if (exact != nullptr) TakeExact(exact, values, field.row(), nullptr, sums);
}

#else

void BlendColors(const DeviceStyleField&, const DeviceRayWeights&, const DeviceSlots&,
                 const Ray*, const float*, Vec3f*, uint8_t*, float*) {
  DeviceWait("blend_colors");
}
void BlendColorsAdjoint(const DeviceStyleField&, const DeviceRayWeights&, const DeviceSlots&,
                        const Ray*, const uint8_t*, const Vec3f*, float*, float*) {
  DeviceWait("blend_colors_adjoint");
}
void BlendRows(const DeviceStyleField&, const DeviceRayWeights&, const DeviceSlots&,
               const float*, float*, float*) {
  DeviceWait("blend_rows");
}

#endif

}  // namespace regrade
