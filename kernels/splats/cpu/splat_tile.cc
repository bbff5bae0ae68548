#include "kernels/splats/cpu/splat_tile.h"

#include <algorithm>
#include <cstring>

namespace regrade {

namespace simd_baseline {
extern const SplatTileFunctions kSplatTiles;
}
namespace simd_avx2 {
extern const SplatTileFunctions kSplatTiles;
}
namespace simd_avx512 {
extern const SplatTileFunctions kSplatTiles;
}

const SplatTileFunctions* SplatTilesFor(const char* name) {
  if (std::strcmp(name, "baseline") == 0) return &simd_baseline::kSplatTiles;
#if defined(REGRADE_X86)
  if (std::strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2") &&
      __builtin_cpu_supports("fma"))
    return &simd_avx2::kSplatTiles;
  if (std::strcmp(name, "avx512") == 0 && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw"))
    return &simd_avx512::kSplatTiles;
#endif
  return nullptr;
}

const SplatTileFunctions& SplatTiles() {
  static const SplatTileFunctions* const kBest = [] {
    for (const char* name : {"avx512", "avx2"})
      if (const SplatTileFunctions* functions = SplatTilesFor(name)) return functions;
    return SplatTilesFor("baseline");
  }();
  return *kBest;
}

void SplatTape::Reserve(const SplatFrame& frame, int tile) {
  const int top = tile / frame.tiles_x * kSplatTile;
  constexpr int kHighest = 4;  // rows of a vector's pixels
  int64_t rows = 0;
  for (int64_t e = frame.first_entry[static_cast<size_t>(tile)];
       e < frame.first_entry[static_cast<size_t>(tile) + 1]; ++e) {
    const PixelBox& box =
        frame.box[static_cast<size_t>(frame.entry_splat[static_cast<size_t>(e)])];
    rows += std::min(
        std::min(box.y1, top + kSplatTile) - std::max(box.y0, top) + 2 * (kHighest - 1),
        kSplatTile);
  }
  transmittance.Reserve(rows * kSplatTile);
  alpha.Reserve(rows * kSplatTile);
  constexpr int kNarrowest = 4;  // pixels of a vector
  entry.Reserve(rows * (kSplatTile / kNarrowest));
  part.Reserve(rows * (kSplatTile / kNarrowest));
}

}  // namespace regrade
