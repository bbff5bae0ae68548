#include "kernels/splats/cpu/splat_frame.h"

#include <omp.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

struct Tiles {
  int x0, y0, x1, y1;

  // Of a box that is not empty.
  explicit Tiles(const PixelBox& box)
      : x0(box.x0 / kSplatTile),
        y0(box.y0 / kSplatTile),
        x1((box.x1 - 1) / kSplatTile + 1),
        y1((box.y1 - 1) / kSplatTile + 1) {}
  int64_t count() const { return int64_t{x1 - x0} * (y1 - y0); }
  int64_t PlaceOf(int x, int y) const { return int64_t{y - y0} * (x1 - x0) + (x - x0); }
};

// Fills seen and box, and the numbers of tiles in first_slot [1 .. splats].
void SeeAll(SplatFrame* frame) {
  const int64_t n = frame->splats.count;
  frame->seen.resize(static_cast<size_t>(n));
  frame->box.resize(static_cast<size_t>(n));
  frame->first_slot.resize(static_cast<size_t>(n) + 1);
  frame->first_slot[0] = 0;
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; ++i) {
    const size_t at = static_cast<size_t>(i);
    PixelBox box;
    if (SeeSplat(frame->camera, frame->options, frame->splats, i, &frame->seen[at]))
      box = ExtentOf(frame->camera, frame->seen[at].ellipse, frame->seen[at].reach);
    frame->box[at] = box;
    frame->first_slot[at + 1] = box.empty() ? 0 : Tiles(box).count();
  }
}

// Sums up first_slot, and counts the entries of tiles in first_entry.
void CountEntries(SplatFrame* frame) {
  frame->first_entry.assign(static_cast<size_t>(frame->num_tiles()) + 1, 0);
  for (size_t i = 0; i < frame->box.size(); ++i) {
    frame->first_slot[i + 1] += frame->first_slot[i];
    if (frame->box[i].empty()) continue;
    const Tiles tiles(frame->box[i]);
    for (int y = tiles.y0; y < tiles.y1; ++y)
      for (int x = tiles.x0; x < tiles.x1; ++x)
        ++frame->first_entry[static_cast<size_t>(y * frame->tiles_x + x) + 1];
  }
  for (size_t tile = 0; tile + 1 < frame->first_entry.size(); ++tile)
    frame->first_entry[tile + 1] += frame->first_entry[tile];
}

struct DepthKey {
  uint32_t bits;  // of a positive float, in the floats' order
  int32_t splat;
};

// The splats that are seen, front to back, then by index: a radix sort, which is stable.
std::vector<DepthKey> ByDepth(const SplatFrame& frame) {
  constexpr int kDigit = 11, kPasses = 3;
  std::vector<DepthKey> keys;
  keys.reserve(frame.seen.size());
  std::array<std::vector<uint32_t>, kPasses> starts;
  starts.fill(std::vector<uint32_t>((1 << kDigit) + 1));
  const auto digit = [](uint32_t bits, int pass) {
    return bits >> (pass * kDigit) & ((1u << kDigit) - 1);
  };
  for (size_t i = 0; i < frame.seen.size(); ++i) {
    if (frame.box[i].empty()) continue;
    DepthKey key{0, static_cast<int32_t>(i)};
    std::memcpy(&key.bits, &frame.seen[i].z, sizeof key.bits);
    for (int pass = 0; pass < kPasses; ++pass)
      ++starts[static_cast<size_t>(pass)][digit(key.bits, pass) + 1];
    keys.push_back(key);
  }
  std::vector<DepthKey> sorted(keys.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    std::vector<uint32_t>& start = starts[static_cast<size_t>(pass)];
    for (size_t d = 1; d < start.size(); ++d) start[d] += start[d - 1];
    for (const DepthKey& key : keys) sorted[start[digit(key.bits, pass)]++] = key;
    keys.swap(sorted);
  }
  return keys;
}

}  // namespace

void MakeSplatFrame(const SplatsView<float>& splats, const Camera& camera,
                    const SplatOptions& options, SplatFrame* frame) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole && !camera.ndc.on());
  REGRADE_CHECK(options.near_plane > 0 && options.blur > 0);
  frame->splats = splats;
  frame->camera = SplatCamera(camera);
  frame->options = options;
  frame->tiles_x = (camera.width + kSplatTile - 1) / kSplatTile;
  frame->tiles_y = (camera.height + kSplatTile - 1) / kSplatTile;
  SeeAll(frame);
  std::vector<DepthKey> keys;
#pragma omp parallel sections
  {
#pragma omp section
    keys = ByDepth(*frame);
#pragma omp section
    CountEntries(frame);
  }
  std::vector<int64_t> next(frame->first_entry.begin(), frame->first_entry.end() - 1);
  frame->entry_splat.resize(static_cast<size_t>(frame->first_slot.back()));
  frame->entry_slot.resize(frame->entry_splat.size());
  // Every band of rows of tiles sees all splats in their order.
  const int bands = std::min(frame->tiles_y, omp_get_max_threads());
#pragma omp parallel for schedule(static, 1)
  for (int band = 0; band < bands; ++band) {
    const int first = frame->tiles_y * band / bands, end = frame->tiles_y * (band + 1) / bands;
    for (const DepthKey& key : keys) {
      const size_t i = static_cast<size_t>(key.splat);
      const Tiles tiles(frame->box[i]);
      for (int y = std::max(first, tiles.y0); y < std::min(end, tiles.y1); ++y)
        for (int x = tiles.x0; x < tiles.x1; ++x) {
          const size_t entry =
              static_cast<size_t>(next[static_cast<size_t>(y * frame->tiles_x + x)]++);
          frame->entry_splat[entry] = key.splat;
          frame->entry_slot[entry] = frame->first_slot[i] + tiles.PlaceOf(x, y);
        }
    }
  }
}

SplatFrame MakeSplatFrame(const SplatsView<float>& splats, const Camera& camera,
                          const SplatOptions& options) {
  SplatFrame frame;
  MakeSplatFrame(splats, camera, options, &frame);
  return frame;
}

void Recolor(const SplatsView<float>& splats, SplatFrame* frame) {
  REGRADE_CHECK_EQ(splats.count, frame->splats.count);
  frame->splats = splats;
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < splats.count; ++i) {
    const size_t at = static_cast<size_t>(i);
    if (frame->box[at].empty()) continue;
    const Splat<float> splat = splats[i];
    frame->seen[at].color = SplatColor(splats.basis, splats.Coefficients(i),
                                       DirectionToMean(frame->camera.center, splat.mean).unit);
  }
}

}  // namespace regrade
