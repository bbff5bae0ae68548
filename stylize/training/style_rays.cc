#include "stylize/training/style_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

// Without rays.
StyleRays BatchOf(const std::vector<StyledTrainingView>& views) {
  StyleRays batch;
  for (const StyledTrainingView& view : views) batch.cameras.push_back(view.camera);
  return batch;
}

void AddPatch(const std::vector<StyledTrainingView>& views, size_t index, int x0, int y0,
              int width, int height, StyleRays* batch) {
  const StyledTrainingView& view = views[index];
  for (int y = y0; y < y0 + height; ++y)
    for (int x = x0; x < x0 + width; ++x) {
      const float* t = view.target->at(x, y);
      Vec3f target{t[0], t[1], t[2]};
      if (view.mask != nullptr && !(*view.mask->at(x, y) >= 0.5f))
        target.x = std::numeric_limits<float>::quiet_NaN();
      // Pictures are clipped to [0, 1], and so is what they are compared with.
      if (AllFinite(target))
        for (int c = 0; c < 3; ++c) target[c] = std::clamp(target[c], 0.0f, 1.0f);
      batch->AddPixel(static_cast<int32_t>(index), x, y);
      batch->targets.push_back(target);
    }
}

struct Part {
  int x0, y0, width, height;
};

Part PartOf(const StyledTrainingView& view) {
  const bool all = view.x1 <= view.x0 || view.y1 <= view.y0;
  return all ? Part{0, 0, view.camera.width, view.camera.height}
             : Part{view.x0, view.y0, view.x1 - view.x0, view.y1 - view.y0};
}

// Element `place` of a random order of n.
size_t InRandomOrder(size_t n, size_t place, uint64_t seed, uint64_t order) {
  std::vector<size_t> all(n);
  std::iota(all.begin(), all.end(), size_t{0});
  for (size_t i = 0; i <= place; ++i)
    std::swap(all[i], all[i + RandomIndex(seed, order, i, n - i)]);
  return all[place];
}

}  // namespace

StyleRays WholeViewRays(const std::vector<StyledTrainingView>& views, bool passes,
                        uint64_t seed, uint64_t step) {
  const size_t n = views.size();
  const size_t index =
      passes ? InRandomOrder(n, step % n, seed, step / n) : RandomIndex(seed, step, 0, n);
  const Part part = PartOf(views[index]);
  StyleRays batch = BatchOf(views);
  AddPatch(views, index, part.x0, part.y0, part.width, part.height, &batch);
  return batch;
}

StyleRays SampleStyleRays(const std::vector<StyledTrainingView>& views, int rays, int patch,
                          uint64_t seed, uint64_t step) {
  StyleRays batch = BatchOf(views);
  const int patches = std::max(1, rays / (patch * patch));
  for (int p = 0; p < patches; ++p) {
    const uint64_t counter = 3 * static_cast<uint64_t>(p);
    const size_t index = RandomIndex(seed, step, counter, views.size());
    const Part part = PartOf(views[index]);
    const int width = std::min(patch, part.width);
    const int height = std::min(patch, part.height);
    const int x0 = static_cast<int>(
        RandomIndex(seed, step, counter + 1, static_cast<uint64_t>(part.width - width + 1)));
    const int y0 = static_cast<int>(
        RandomIndex(seed, step, counter + 2, static_cast<uint64_t>(part.height - height + 1)));
    AddPatch(views, index, part.x0 + x0, part.y0 + y0, width, height, &batch);
  }
  return batch;
}

int64_t RaysPerStep(int rays, int patch) {
  if (rays <= 0) return 0;
  const int64_t square = int64_t{patch} * patch;
  return std::max<int64_t>(1, rays / square) * square;
}

int64_t ValidateViews(const std::vector<StyledTrainingView>& views) {
  if (views.empty())
    throw InputError("no styled view to learn from", "", "keep some training views");
  int64_t left_out = 0;
  for (const StyledTrainingView& view : views) {
    REGRADE_CHECK(view.target != nullptr);
    const Image& target = *view.target;
    if (target.width != view.camera.width || target.height != view.camera.height ||
        target.channels != 3)
      throw InputError(Concat("the styled view is ", target.width, "x", target.height,
                              ", its photo ", view.camera.width, "x", view.camera.height),
                       view.name, "the 2D method must keep the picture's size");
    if (view.mask != nullptr) REGRADE_CHECK(view.mask->SameSize(target));
    int64_t bad = 0;
    for (int64_t i = 0; i < target.num_pixels(); ++i) {
      const float* p = &target.pixels[static_cast<size_t>(i) * 3];
      bad += !(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]));
    }
    if (bad * 100 > target.num_pixels())
      throw InputError(
          Concat(bad, " of ", target.num_pixels(), " pixels of the styled view are not finite"),
          view.name, "the 2D method failed on this view");
    left_out += bad;
  }
  return left_out;
}

}  // namespace regrade
