#include "kernels/splats/cpu/splat_frame.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Fills seen and box, front to back.
void SeeInOrder(SplatFrame* frame) {
  const int64_t n = frame->splats.count;
  std::vector<SeenSplat<float>> seen(static_cast<size_t>(n));
  std::vector<PixelBox> box(static_cast<size_t>(n));  // empty: not seen
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; ++i) {
    SeenSplat<float>& own = seen[static_cast<size_t>(i)];
    if (SeeSplat(frame->camera, frame->options, frame->splats, i, &own))
      box[static_cast<size_t>(i)] = ExtentOf(frame->camera, own.ellipse, own.reach);
  }
  // The bits of positive floats are in the floats' order; the lower half is the index.
  std::vector<uint64_t> keys;
  for (int64_t i = 0; i < n; ++i) {
    if (box[static_cast<size_t>(i)].empty()) continue;
    uint32_t bits;
    std::memcpy(&bits, &seen[static_cast<size_t>(i)].z, sizeof bits);
    keys.push_back(uint64_t{bits} << 32 | static_cast<uint64_t>(i));
  }
  std::sort(keys.begin(), keys.end());
  frame->seen.reserve(keys.size());
  frame->box.reserve(keys.size());
  for (const uint64_t key : keys) {
    frame->seen.push_back(seen[key & 0xFFFFFFFF]);
    frame->box.push_back(box[key & 0xFFFFFFFF]);
  }
}

// Calls add(tile) for the tiles of a box, in their order.
template <typename Add>
void ForTiles(const SplatFrame& frame, const PixelBox& box, const Add& add) {
  for (int y = box.y0 / kSplatTile; y <= (box.y1 - 1) / kSplatTile; ++y)
    for (int x = box.x0 / kSplatTile; x <= (box.x1 - 1) / kSplatTile; ++x)
      add(static_cast<size_t>(y * frame.tiles_x + x));
}

}  // namespace

SplatFrame MakeSplatFrame(const SplatsView<float>& splats, const Camera& camera,
                          const SplatOptions& options) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole && !camera.ndc.on());
  REGRADE_CHECK(options.near_plane > 0 && options.blur > 0);
  SplatFrame frame;
  frame.splats = splats;
  frame.camera = SplatCamera(camera);
  frame.options = options;
  frame.tiles_x = (camera.width + kSplatTile - 1) / kSplatTile;
  frame.tiles_y = (camera.height + kSplatTile - 1) / kSplatTile;
  SeeInOrder(&frame);
  frame.first_slot.assign(1, 0);
  frame.first_entry.assign(static_cast<size_t>(frame.num_tiles()) + 1, 0);
  for (const PixelBox& box : frame.box) {
    int64_t slots = frame.first_slot.back();
    ForTiles(frame, box, [&](size_t tile) { ++slots, ++frame.first_entry[tile + 1]; });
    frame.first_slot.push_back(slots);
  }
  for (size_t tile = 0; tile + 1 < frame.first_entry.size(); ++tile)
    frame.first_entry[tile + 1] += frame.first_entry[tile];
  std::vector<int64_t> next(frame.first_entry.begin(), frame.first_entry.end() - 1);
  frame.entry_splat.resize(static_cast<size_t>(frame.first_slot.back()));
  frame.entry_slot.resize(frame.entry_splat.size());
  for (size_t k = 0; k < frame.box.size(); ++k) {
    int64_t slot = frame.first_slot[k];
    ForTiles(frame, frame.box[k], [&](size_t tile) {
      const size_t entry = static_cast<size_t>(next[tile]++);
      frame.entry_splat[entry] = static_cast<int32_t>(k);
      frame.entry_slot[entry] = slot++;
    });
  }
  return frame;
}

}  // namespace regrade
