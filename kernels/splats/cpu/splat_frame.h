// The splats that a camera sees, and those of each tile of the picture, front to back.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/splats/seen_splat.h"

namespace regrade {

inline constexpr int kSplatTile = 16;  // pixels, both sides

// An entry is a splat in a tile. `splats` must outlive the frame.
struct SplatFrame {
  SplatsView<float> splats;
  SplatCamera camera;
  SplatOptions options;
  std::vector<SeenSplat<float>> seen;  // [splats]: undefined where the box is empty
  std::vector<PixelBox> box;           // [splats]: pixels that may see the splat
  std::vector<int64_t> first_slot;     // [splats + 1]: entries numbered by splat, then by tile
  int tiles_x = 0, tiles_y = 0;
  std::vector<int64_t> first_entry;  // [tiles + 1]: entries by tile, then front to back
  std::vector<int32_t> entry_splat;  // [entries]
  std::vector<int64_t> entry_slot;   // [entries]

  int num_tiles() const { return tiles_x * tiles_y; }
};

// Requires what SeeSplats does. The result does not depend on the number of threads, nor on
// what the frame held before, whose memory is used again.
void MakeSplatFrame(const SplatsView<float>& splats, const Camera& camera,
                    const SplatOptions& options, SplatFrame* frame);
SplatFrame MakeSplatFrame(const SplatsView<float>& splats, const Camera& camera,
                          const SplatOptions& options);

// Gives the seen splats the colours of `splats`, of the same geometry.
void Recolor(const SplatsView<float>& splats, SplatFrame* frame);

}  // namespace regrade
