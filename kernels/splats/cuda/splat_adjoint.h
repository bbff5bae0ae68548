// The gradient by the values of every seen splat, handed to a functor splat by splat: an
// optimizer that is one needs no memory for gradients.
#pragma once

#include "kernels/splats/cuda/splat_record.h"
#include "kernels/splats/cuda/tile_adjoint.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

#if defined(__CUDACC__)
#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/by_splat_basis.h"
#include "kernels/splats/cuda/own_splat.h"
#include "kernels/splats/cuda/seen_list.h"
#include "kernels/splats/seen_splat.h"
#endif

namespace regrade {

// Device pointers of what DeviceSplatRenderer leaves after SumPixels.
struct SplatSumsView {
  SplatsView<float> splats;  // as they were rendered
  SplatCamera camera;
  SplatOptions options;
  const SplatRecord* record = nullptr;  // [splats]
  const int32_t* num_tiles = nullptr;   // [splats]; 0: not seen
  const int32_t* first_slot = nullptr;  // [splats]
  const SlotSums* sums = nullptr;       // [slots]: a splat's sums are in its first slot
  const Vec3f* d_background = nullptr;  // [1]
};

// d_sh [3, basis] of a splat: products of the harmonics and the colour's gradient, made where
// they are used. k must be known when a loop is unrolled, or the harmonics leave the registers.
template <int kBasis>
struct ShGradient {
  float gamma[kBasis];
  Vec3f d_color;  // 0 where the colour is 0, see EQ(splat-color)

  HD float operator[](int k) const { return d_color[k / kBasis] * gamma[k % kBasis]; }
};

#if defined(__CUDACC__)

namespace splat_adjoint {

constexpr int kBlock = 128;  // threads

template <int kBasis, typename Use>
__device__ void UseOne(const SplatSumsView& view, int64_t i, const Use& use) {
  const SlotSums slot = view.sums[view.first_slot[i]];
  SplatSums<float> sums;
  for (int a = 0; a < 2; ++a) sums.ellipse.h[a] = slot.h[a];
  for (int a = 0; a < 3; ++a) sums.ellipse.H[a] = slot.H[a];
  sums.ellipse.f = slot.f;
  sums.color = slot.color;
  sums.z = slot.z;
  SeenSplat<float> seen;
  seen.color = view.record[i].color;
  OwnSplat<kBasis> own;
  own.LoadShape(view.splats, i);
  own.LoadColor(view.splats, i);
  Splat<float> d{};
  float unused[3 * kBasis] = {};
  SeeSplatAdjoint(view.camera, view.options, own.view(), seen, sums, &d, unused);
  ShGradient<kBasis> d_sh;
  ShBasisTo3(kBasis, DirectionToMean(view.camera.center, own.values.mean).unit, d_sh.gamma);
  for (int c = 0; c < 3; ++c) d_sh.d_color[c] = seen.color[c] > 0 ? sums.color[c] : 0.0f;
  use(i, d, d_sh);
}

template <int kBasis, typename Use>
__global__ void __launch_bounds__(kBlock, 4) UseGradients(SplatSumsView view, Use use) {
  SeenList<kBlock>::ForSeen(view.num_tiles, view.splats.count,
                            [&](int64_t i) { UseOne<kBasis>(view, i, use); });
}

}  // namespace splat_adjoint

// Calls use(index, d, d_sh) on the device, once for each splat that meets a tile of the picture:
//   template <int kBasis>
//   __device__ void operator()(int64_t index, const Splat<float>& d,
//                              const ShGradient<kBasis>& d_sh) const;
// by a thread that reads no other splat's values, and its own before the call: `use` may change
// the values of splat `index`. The same bits in every run.
template <typename Use>
void UseSplatGradients(const SplatSumsView& view, const Use& use) {
  using namespace splat_adjoint;
  if (view.splats.count == 0) return;
  BySplatBasis(view.splats.basis, [&](auto basis) {
    UseGradients<basis(), Use>
        <<<SeenList<kBlock>::Blocks(view.splats.count), kBlock, 0, LaunchStream()>>>(view, use);
  });
  CheckLaunch("use_splat_gradients");
}

#endif

}  // namespace regrade
