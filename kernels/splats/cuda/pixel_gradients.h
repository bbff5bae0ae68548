// The gradient by a picture's pixels, in the order of tiles, and the gradient by the
// background.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/cuda/composite_tiles.h"

namespace regrade {

struct alignas(16) PixelGradient {
  Vec3f color;  // d_C
  // <C, d_C> + Z d_Z + T_N d_T: with the background in C, what the pixel's splats and what is
  // behind them add to the loss.
  float total;
};

struct TileGradients {
  PixelGradient* pixel = nullptr;  // [tiles, kTilePixels]; 0 beyond the picture
  float* depth = nullptr;          // [tiles, kTilePixels]: d_Z; or null: all are 0
  Vec3f* background = nullptr;     // [2 tiles]: sum T_N d_C of half a tile
  Vec3f* d_background = nullptr;   // [1]: sum T_N d_C
};

// `picture` must have its depth if `d` has one; null arrays of `d` are zeros.
void GatherPixelGradients(const TileGrid& grid, const SplatPixels<float>& picture,
                          const SplatPixels<const float>& d, const TileGradients& gradients);

}  // namespace regrade
