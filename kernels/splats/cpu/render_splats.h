// Pictures of splats and their gradients on the CPU's fast path: tiles in parallel, each with
// its own list of splats. The same bits for any number of threads.
#pragma once

#include "kernels/base/buffer.h"
#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/cpu/splat_tile.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// As RenderSplatsPlain. The first writes all of a picture of the frame's size.
void RenderSplats(const SplatFrame& frame, SplatPicture<float>* picture,
                  const SplatTileFunctions& tiles = SplatTiles());
SplatPicture<float> RenderSplats(const SplatFrame& frame,
                                 const SplatTileFunctions& tiles = SplatTiles());

// Kept between pictures, so that their memory is not fetched anew.
struct SplatTileSums {
  Buffer<SplatSums<float>> of_slot;  // [slots]: of a splat over the pixels of a tile
  Vec3f d_background;
};

// The gradient's sums over pixels; a tile's are in float.
void SumOverTiles(const SplatFrame& frame, const SplatPicture<float>& d_picture,
                  SplatTileSums* sums, const SplatTileFunctions& tiles = SplatTiles());

// Calls use(index, d, d_sh [3, basis]) with the gradient by each splat from `first` on, in
// parallel; 0 by those that are not seen. The tiles of a splat are summed in double, in their
// order.
template <typename Use>
void ForEachGradient(const SplatFrame& frame, const SplatTileSums& sums, const Use& use,
                     int64_t first = 0) {
#pragma omp parallel for schedule(static)
  for (int64_t i = first; i < frame.splats.count; ++i) {
    const size_t at = static_cast<size_t>(i);
    Splat<float> d{};
    float d_sh[3 * kMaxBasis] = {};
    if (!frame.box[at].empty()) {
      SplatSums<double> total;
      for (int64_t s = frame.first_slot[at]; s < frame.first_slot[at + 1]; ++s)
        total.Add(sums.of_slot[s]);
      SeeSplatAdjoint(frame.camera, frame.options, frame.splats, frame.seen[at], total, &d,
                      d_sh);
    }
    use(i, d, d_sh);
  }
}

// As RenderSplatsPlainAdjoint.
SplatArrays<float> RenderSplatsAdjoint(const SplatFrame& frame,
                                       const SplatPicture<float>& d_picture,
                                       const SplatTileFunctions& tiles = SplatTiles());

}  // namespace regrade
