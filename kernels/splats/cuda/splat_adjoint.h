// The gradient by the values of every seen splat, handed to a functor splat by splat: an
// optimizer that is one needs no memory for gradients.
#pragma once

#include "kernels/splats/cuda/splat_record.h"
#include "kernels/splats/cuda/tile_adjoint.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

#if defined(__CUDACC__)
#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/by_splat_basis.h"
#include "kernels/splats/cuda/own_splat.h"
#include "kernels/splats/seen_splat.h"
#endif

namespace regrade {

// Device pointers of what DeviceSplatRenderer leaves after SumPixels.
struct SplatSumsView {
  SplatsView<float> splats;  // as they were rendered
  SplatCamera camera;
  SplatOptions options;
  TileGrid grid;
  const SplatRecord* record = nullptr;   // [splats]
  const int32_t* num_tiles = nullptr;    // [splats]; 0: not seen
  const int32_t* first_slot = nullptr;   // [splats]
  const uint64_t* last = nullptr;        // [tiles], see KeptTiles
  const SlotSums* sums = nullptr;        // [slots]
  const Vec3f* d_background = nullptr;   // [1]
};

#if defined(__CUDACC__)

namespace splat_adjoint {

constexpr int kManyTiles = 48;  // a warp shares the work for splats with more
constexpr int kBlock = 128;     // threads

__device__ inline void AddSlot(const SlotSums& slot, SplatSums<double>* sums) {
  for (int a = 0; a < 2; ++a) sums->ellipse.h[a] += slot.h[a];
  for (int a = 0; a < 3; ++a) sums->ellipse.H[a] += slot.H[a];
  sums->ellipse.f += slot.f;
  sums->color += slot.color.Cast<double>();
  sums->z += slot.z;
}

// All lanes' values, in a fixed order; the same in all lanes.
__device__ inline double SumOfLanes(double value) {
  for (int step = 16; step > 0; step /= 2) value += __shfl_xor_sync(0xFFFFFFFF, value, step);
  return value;
}

__device__ inline SplatSums<double> SumOfLanes(SplatSums<double> sums) {
  for (double& h : sums.ellipse.h) h = SumOfLanes(h);
  for (double& h : sums.ellipse.H) h = SumOfLanes(h);
  sums.ellipse.f = SumOfLanes(sums.ellipse.f);
  for (int c = 0; c < 3; ++c) sums.color[c] = SumOfLanes(sums.color[c]);
  sums.z = SumOfLanes(sums.z);
  return sums;
}

// Calls for_tiles(add) with add(tile, place) for tiles of splat i; adds those that were written.
template <typename ForTiles>
__device__ void AddSlots(const SplatSumsView& view, int32_t i, const SplatRecord& record,
                         SplatSums<double>* sums, const ForTiles& for_tiles) {
  const uint64_t order = OrderOf(__float_as_uint(record.z), i);
  const SlotSums* const slots = view.sums + view.first_slot[i];
  for_tiles([&](int tile, int place) {
    if (order <= view.last[tile]) AddSlot(slots[place], sums);
  });
}

template <int kBasis, typename Use>
__global__ void __launch_bounds__(kBlock) UseGradients(SplatSumsView view, Use use) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int tiles = i < view.splats.count ? view.num_tiles[i] : 0;
  SplatRecord record;
  SplatSums<double> sums;
  if (tiles > 0) record = view.record[i];
  if (tiles > 0 && tiles <= kManyTiles)
    AddSlots(view, static_cast<int32_t>(i), record, &sums, [&](const auto& add) {
      SplatTiles(record, view.grid).ForAll(add);
    });
  for (unsigned many = __ballot_sync(0xFFFFFFFF, tiles > kManyTiles); many != 0;
       many &= many - 1) {
    const int lane = __ffs(static_cast<int>(many)) - 1;
    const int32_t shared = static_cast<int32_t>(__shfl_sync(0xFFFFFFFF, i, lane));
    const SplatRecord its = view.record[shared];
    SplatSums<double> part;
    AddSlots(view, shared, its, &part, [&](const auto& add) {
      SplatTiles(its, view.grid).ForAllByWarp(add);
    });
    part = SumOfLanes(part);
    if (static_cast<int>(threadIdx.x % 32) == lane) sums = part;
  }
  if (tiles == 0) return;

  OwnSplat<kBasis> own;
  own.LoadShape(view.splats, i);
  own.LoadColor(view.splats, i);
  SeenSplat<float> seen;
  seen.color = record.color;
  Splat<float> d{};
  float d_sh[3 * kBasis] = {};
  SeeSplatAdjoint(view.camera, view.options, own.view(), seen, sums, &d, d_sh);
  use(i, d, d_sh, kBasis);
}

}  // namespace splat_adjoint

// Calls use(index, d, d_sh [3, basis], basis) on the device, once for each splat that meets a
// tile of the picture, by a thread that reads no other splat's values: `use` may change those of
// splat `index`. The same bits in every run.
template <typename Use>
void UseSplatGradients(const SplatSumsView& view, const Use& use) {
  using splat_adjoint::kBlock;
  if (view.splats.count == 0) return;
  const unsigned blocks = static_cast<unsigned>((view.splats.count + kBlock - 1) / kBlock);
  BySplatBasis(view.splats.basis, [&](auto basis) {
    splat_adjoint::UseGradients<basis(), Use>
        <<<blocks, kBlock, 0, LaunchStream()>>>(view, use);
  });
  CheckLaunch("use_splat_gradients");
}

#endif

}  // namespace regrade
