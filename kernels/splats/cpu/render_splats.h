// Pictures of splats and their gradients on the CPU's fast path: tiles in parallel, each with
// its own list of splats. The same bits for any number of threads.
#pragma once

#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/cpu/splat_tile.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// As RenderSplatsPlain.
SplatPicture<float> RenderSplats(const SplatFrame& frame,
                                 const SplatTileFunctions& tiles = SplatTiles());

// As RenderSplatsPlainAdjoint. A tile's pixels are summed in float, the tiles of a splat in
// double, in their order.
SplatArrays<float> RenderSplatsAdjoint(const SplatFrame& frame,
                                       const SplatPicture<float>& d_picture,
                                       const SplatTileFunctions& tiles = SplatTiles());

}  // namespace regrade
