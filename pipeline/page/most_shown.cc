#include "pipeline/page/most_shown.h"

#include <algorithm>
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

std::vector<uint8_t> MostShown(const RadianceField& field, const std::vector<Camera>& cameras,
                               int64_t most) {
  const int64_t count = field.geometry->num_voxels();
  std::vector<double> shown(static_cast<size_t>(count));
  const auto weigher =
      MakeRayWeigher(*field.geometry, field.near_clip, field.march, kLeastWeight);
  for (const Camera& camera : cameras) AddShown(camera, weigher.get(), &shown);
  std::vector<int64_t> order(shown.size());
  std::iota(order.begin(), order.end(), 0);
  most = std::min(most, count);
  std::ranges::nth_element(order, order.begin() + most, [&](int64_t a, int64_t b) {
    const double of_a = shown[static_cast<size_t>(a)], of_b = shown[static_cast<size_t>(b)];
    return of_a != of_b ? of_a > of_b : a < b;
  });
  std::vector<uint8_t> marked(shown.size());
  for (int64_t i = 0; i < most; ++i)
    marked[static_cast<size_t>(order[static_cast<size_t>(i)])] = 1;
  return marked;
}

}  // namespace regrade
