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

// d_sh of a splat is made of this: the harmonics of `direction` times d_color.
struct ColorSums {
  Vec3f direction, d_color;  // d_color: 0 where the colour is 0, see EQ(splat-color)
};

// Device pointers of what DeviceSplatRenderer leaves after SumPixels.
struct SplatSumsView {
  SplatsView<float> splats;  // as they were rendered
  SplatCamera camera;
  SplatOptions options;
  const SplatRecord* record = nullptr;  // [splats]
  const int32_t* num_tiles = nullptr;   // [splats]; 0: not seen
  const int32_t* first_slot = nullptr;  // [splats]
  const SlotSums* sums = nullptr;       // [slots]: a splat's sums are in its first slot
  ColorSums* color = nullptr;           // [splats]: scratch
  const Vec3f* d_background = nullptr;  // [1]
};

#if defined(__CUDACC__)

namespace splat_adjoint {

constexpr int kBlock = 128;  // threads

template <int kBasis>
__device__ Splat<float> AdjointOf(const SplatSumsView& view, int64_t i) {
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
  for (int c = 0; c < 3; ++c) sums.color[c] = seen.color[c] > 0 ? sums.color[c] : 0.0f;
  view.color[i] = {DirectionToMean(view.camera.center, own.values.mean).unit, sums.color};
  return d;
}

template <int kBasis, typename Use>
__global__ void __launch_bounds__(kBlock, 4) UseShapes(SplatSumsView view, Use use) {
  using List = SeenList<kBlock>;
  __shared__ uint16_t list[List::kChunk];
  const int total = List::Make(view.num_tiles, view.splats.count, list);
  for (int k = static_cast<int>(threadIdx.x); k < total; k += kBlock) {
    const int64_t i = List::First() + list[k];
    use.Shape(i, AdjointOf<kBasis>(view, i));
  }
}

// Neighbouring threads have neighbouring coefficients: a splat's row of them is long.
template <int kBasis, typename Use>
__global__ void __launch_bounds__(kBlock) UseColors(SplatSumsView view, Use use) {
  using List = SeenList<kBlock>;
  constexpr int kValues = 3 * kBasis, kParts = kValues % 4 == 0 ? 4 : 1;
  constexpr int kOfSplat = kValues / kParts;
  __shared__ uint16_t list[List::kChunk];
  __shared__ float gamma[kBlock][kBasis], d_color[kBlock][3];
  const int total = List::Make(view.num_tiles, view.splats.count, list);
  const int thread = static_cast<int>(threadIdx.x);
  for (int begin = 0; begin < total; begin += kBlock) {
    const int count = min(kBlock, total - begin);
    if (thread < count) {
      const ColorSums own = view.color[List::First() + list[begin + thread]];
      float harmonics[kBasis];
      ShBasis(kBasis, own.direction, harmonics);
      for (int k = 0; k < kBasis; ++k) gamma[thread][k] = harmonics[k];
      for (int c = 0; c < 3; ++c) d_color[thread][c] = own.d_color[c];
    }
    __syncthreads();
    for (int part = thread; part < count * kOfSplat; part += kBlock) {
      const int place = part / kOfSplat, first = part % kOfSplat * kParts;
      float d[kParts];
#pragma unroll
      for (int p = 0; p < kParts; ++p)
        d[p] = d_color[place][(first + p) / kBasis] * gamma[place][(first + p) % kBasis];
      const int64_t i = List::First() + list[begin + place];
      use.template Color<kParts>(kValues * i + first, first, d);
    }
    __syncthreads();
  }
}

}  // namespace splat_adjoint

// Hands all gradients of splats that meet a tile of the picture to `use`, on the device, once:
//   __device__ void Shape(int64_t index, const Splat<float>& d) const;
//     all but the colour of splat `index`;
//   template <int kCount>
//   __device__ void Color(int64_t at, int k, const float* d) const;
//     of the coefficients sh[at], ..., sh[at + kCount - 1], which are k, k + 1 ... of the
//     [3, basis] of their splat. kCount is 4 for a basis of 4 or 16, with `at` a multiple of 4,
//     and otherwise 1.
// All of a splat's values are read before any of its gradients is handed out, and by no other
// splat's thread: `use` may change the values whose gradient it has. The same bits in every
// run.
template <typename Use>
void UseSplatGradients(const SplatSumsView& view, const Use& use) {
  using namespace splat_adjoint;
  if (view.splats.count == 0) return;
  BySplatBasis(view.splats.basis, [&](auto basis) {
    const unsigned blocks = SeenList<kBlock>::Blocks(view.splats.count);
    UseShapes<basis(), Use><<<blocks, kBlock, 0, LaunchStream()>>>(view, use);
    UseColors<basis(), Use><<<blocks, kBlock, 0, LaunchStream()>>>(view, use);
  });
  CheckLaunch("use_splat_gradients");
}

#endif

}  // namespace regrade
