#include "pipeline/page/most_shown.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "kernels/render/ray_weigher.h"

namespace regrade {
namespace {

constexpr int kRowsAtOnce = 64;  // of a picture, whose samples are kept for so long
constexpr float kLeastWeight = 1.0f / 1024;

void AddShown(const Camera& camera, RayWeigher* weigher, std::vector<double>* shown) {
  for (int top = 0; top < camera.height; top += kRowsAtOnce) {
    ViewRays rays{.cameras = {camera}};
    for (int y = top; y < std::min(top + kRowsAtOnce, camera.height); ++y)
      for (int x = 0; x < camera.width; ++x) rays.AddPixel(0, x, y);
    for (const WeightedSample& sample : weigher->Weigh(rays).samples)
      (*shown)[static_cast<size_t>(sample.vertex)] += double{sample.weight};
  }
}

}  // namespace

std::vector<int64_t> ByWhatIsShown(const RadianceField& field,
                                   const std::vector<Camera>& cameras) {
  std::vector<double> shown(static_cast<size_t>(field.geometry->num_voxels()));
  const auto weigher =
      MakeRayWeigher(*field.geometry, field.near_clip, field.march, kLeastWeight);
  for (const Camera& camera : cameras) AddShown(camera, weigher.get(), &shown);
  std::vector<int64_t> order(shown.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater(),
                           [&](int64_t i) { return shown[static_cast<size_t>(i)]; });
  return order;
}

}  // namespace regrade
