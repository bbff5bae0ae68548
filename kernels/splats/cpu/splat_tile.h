// One tile of a picture of splats on the CPU, a vector of neighbouring pixels at a time; the
// functions differ by instruction set. Parity tests compare them with the plain picture.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// What the forward pass keeps of each splat at each vector of pixels, for the way back.
struct SplatTape {
  Buffer<float> transmittance, alpha;  // [items, width of a vector]
  Buffer<int32_t> entry, part;         // [items]: entry in the tile, vector in the tile

  // Makes room for all items of a tile.
  void Reserve(const SplatFrame& frame, int tile);
};

struct SplatTileFunctions {
  const char* name;
  // Writes the tile's pixels.
  void (*render)(const SplatFrame&, int tile, SplatPicture<float>*);
  // Adds to sums [slots] of the tile's entries, and to the background's gradient.
  void (*adjoint)(const SplatFrame&, int tile, const SplatPicture<float>& d_picture, SplatTape*,
                  SplatSums<float>* sums, Vec3f* d_background);
};

const SplatTileFunctions& SplatTiles();
// For tests and benchmarks: "baseline", "avx2", "avx512"; nullptr if the processor lacks it.
const SplatTileFunctions* SplatTilesFor(const char* name);

}  // namespace regrade
