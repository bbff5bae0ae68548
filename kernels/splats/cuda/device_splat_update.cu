#include <algorithm>

#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/device_splat_update.h"

namespace regrade {

void DeviceSplatMoments::Reserve(int64_t capacity) {
  for (DeviceSplats* splats : {&value, &first, &second}) splats->Reserve(capacity);
}

SplatMoments DeviceSplatMoments::pointers() const {
  const auto of = [](const DeviceSplats& splats) {
    return SplatPointers{splats.mean.data(), splats.log_scale.data(), splats.quaternion.data(),
                         splats.opacity_logit.data(), splats.sh.data()};
  };
  return {of(value), of(first), of(second)};
}

#if defined(__CUDACC__)

namespace {

struct UpdateUse {
  SplatUpdate update;
  SplatMoments to;
  int basis;
  uint32_t* rejected;

  __device__ void Shape(int64_t i, const Splat<float>& d) const {
    if (i >= update.frozen && !UpdateShape(update, i, d, to)) atomicAdd(rejected, 1u);
  }
  template <int kCount>
  __device__ void Color(int64_t at, int k, const float* d) const {
    if (at < 3 * basis * update.frozen) return;
#pragma unroll
    for (int p = 0; p < kCount; ++p)
      if (!UpdateColor(update, (k + p) % basis == 0, d[p], at + p, to)) atomicAdd(rejected, 1u);
  }
};

__global__ void UnseenShapesKernel(SplatUpdate update, SplatMoments to,
                                   const int32_t* num_tiles, int64_t count) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= update.frozen && i < count && num_tiles[i] == 0) UpdateShape(update, i, {}, to);
}

__global__ void UnseenColorsKernel(SplatUpdate update, SplatMoments to,
                                   const int32_t* num_tiles, int64_t count, int basis) {
  const int64_t k = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (k < 3 * basis * update.frozen || k >= 3 * basis * count ||
      num_tiles[k / (3 * basis)] != 0)
    return;
  UpdateColor(update, k % basis == 0, 0, k, to);
}

// One thread for each value of the copied splats.
__global__ void CopiedKernel(const CopiedSplat* copied, int64_t count, int basis,
                             SplatMoments to) {
  const int64_t values = 11 + 3 * basis;
  const int64_t t = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (t >= values * count) return;
  const CopiedSplat own = copied[t / values];
  const int64_t k = t % values, i = own.index;
  for (const SplatPointers* moment : {&to.first, &to.second}) {
    if (k < 3)
      moment->mean[3 * i + k] = 0;
    else if (k < 6)
      moment->log_scale[3 * i + k - 3] = 0;
    else if (k < 10)
      moment->quaternion[4 * i + k - 6] = 0;
    else if (k < 11)
      moment->opacity_logit[i] = 0;
    else
      moment->sh[3 * basis * i + k - 11] = 0;
  }
  if (k >= 3 && k < 6) to.value.log_scale[3 * i + k - 3] += own.log_factor;
  if (k == 10) to.value.opacity_logit[i] = own.opacity_logit;
}

__global__ void CopiesKernel(const SplatCopy* copies, int64_t count, int basis,
                             SplatMoments to) {
  const int64_t values = 11 + 3 * basis;
  const int64_t t = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (t >= values * count) return;
  const SplatCopy own = copies[t / values];
  const int64_t k = t % values;
  const auto copy = [&](float* of, int64_t each, int64_t part) {
    of[each * own.to + part] = of[each * own.from + part];
  };
  for (const SplatPointers* of : {&to.value, &to.first, &to.second}) {
    if (k < 3)
      copy(of->mean, 3, k);
    else if (k < 6)
      copy(of->log_scale, 3, k - 3);
    else if (k < 10)
      copy(of->quaternion, 4, k - 6);
    else if (k < 11)
      copy(of->opacity_logit, 1, 0);
    else
      copy(of->sh, 3 * basis, k - 11);
  }
}

}  // namespace

void UpdateSplats(const SplatUpdate& update, const SplatSumsView& gradients,
                  const DeviceSplatMoments& splats, uint32_t* rejected) {
  const int64_t count = splats.value.count;
  const int basis = splats.value.basis;
  if (count == 0) return;
  const SplatMoments to = splats.pointers();
  UseSplatGradients(gradients, UpdateUse{update, to, basis, rejected});
  UnseenShapesKernel<<<BlocksFor(count), kThreads, 0, LaunchStream()>>>(
      update, to, gradients.num_tiles, count);
  UnseenColorsKernel<<<BlocksFor(3 * basis * count), kThreads, 0, LaunchStream()>>>(
      update, to, gradients.num_tiles, count, basis);
  CheckLaunch("update_splats");
}

void ApplyChangeOnDevice(const PopulationChange& change, DeviceSplatMoments* splats) {
  if (change.count > splats->value.capacity())
    splats->Reserve(std::max(change.count, splats->value.capacity() * 3 / 2));
  for (DeviceSplats* of : {&splats->value, &splats->first, &splats->second})
    of->count = change.count;
  const int64_t copied = static_cast<int64_t>(change.copied.size());
  const int64_t copies = static_cast<int64_t>(change.copies.size());
  if (copied == 0) return;
  DeviceBuffer<CopiedSplat> of_copied(copied, "copied splats");
  DeviceBuffer<SplatCopy> of_copies(copies, "copies of splats");
  of_copied.CopyIn(change.copied.data(), copied);
  of_copies.CopyIn(change.copies.data(), copies);
  const int basis = splats->value.basis;
  const SplatMoments to = splats->pointers();
  CopiedKernel<<<BlocksFor((11 + 3 * basis) * copied), kThreads, 0, LaunchStream()>>>(
      of_copied.data(), copied, basis, to);
  CopiesKernel<<<BlocksFor((11 + 3 * basis) * copies), kThreads, 0, LaunchStream()>>>(
      of_copies.data(), copies, basis, to);
  DeviceWait("change_population");
}

#else

void UpdateSplats(const SplatUpdate&, const SplatSumsView&, const DeviceSplatMoments&,
                  uint32_t*) {
  DeviceWait("update_splats");
}

void ApplyChangeOnDevice(const PopulationChange&, DeviceSplatMoments*) {
  DeviceWait("change_population");
}

#endif

}  // namespace regrade
