#include "reconstruct/views/scene_extent.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace regrade {
namespace {

using WeightedValues = std::vector<std::pair<double, double>>;  // value, weight

double WeightOf(WeightedValues::iterator begin, WeightedValues::iterator end) {
  double sum = 0;
  for (; begin != end; ++begin) sum += begin->second;
  return sum;
}

// The value below which the part `q` of the weight lies; 0 without values. Changes their order.
double WeightedQuantile(WeightedValues* values, double q) {
  auto begin = values->begin(), end = values->end();
  if (begin == end) return 0;
  double below = q * WeightOf(begin, end);  // what is left of it in front of the value
  while (end - begin > 1) {
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(begin, middle, end);
    const double lower = WeightOf(begin, middle);
    if (lower >= below) {
      end = middle;
    } else {
      below -= lower;
      begin = middle;
    }
  }
  return begin->first;
}

}  // namespace

double SizeOf(const Splat<float>& splat) {
  const double a = splat.log_scale[0], b = splat.log_scale[1], c = splat.log_scale[2];
  const double middle = std::max(std::min(a, b), std::min(std::max(a, b), c));
  return std::exp(std::clamp(middle, -80.0, 80.0));
}

SplatExtent ExtentOf(const Splats& splats, SplatWeight by) {
  SplatExtent extent;
  const SplatsView<float> view = splats.view();
  WeightedValues values(static_cast<size_t>(view.count));
  double finest = 0;  // smaller ones count as this
  if (by == SplatWeight::kDetail) {
    for (int64_t i = 0; i < view.count; ++i)
      values[static_cast<size_t>(i)] = {SizeOf(view[i]), 1};
    finest = WeightedQuantile(&values, 0.01);
  }
  const auto weight = [&](int64_t i) {
    const double opacity = 1 / (1 + std::exp(-double{view.opacity_logit[i]}));
    return by == SplatWeight::kDetail ? opacity / std::max(finest, SizeOf(view[i])) : opacity;
  };
  for (int a = 0; a < 3; ++a) {
    for (int64_t i = 0; i < view.count; ++i)
      values[static_cast<size_t>(i)] = {view.mean[3 * i + a], weight(i)};
    extent.center[a] = WeightedQuantile(&values, 0.5);
  }
  for (int64_t i = 0; i < view.count; ++i)
    values[static_cast<size_t>(i)] = {Norm(view[i].mean.Cast<double>() - extent.center),
                                      weight(i)};
  extent.radius = WeightedQuantile(&values, 0.9);
  extent.inner = WeightedQuantile(&values, 0.5);
  extent.outer = WeightedQuantile(&values, 0.98);
  if (!(extent.radius > 0)) extent.radius = 1;
  if (!(extent.outer > 0)) extent.outer = extent.radius;
  if (!(extent.inner > 0)) extent.inner = extent.radius;
  return extent;
}

std::vector<int64_t> OpaqueSplats(const SplatsView<float>& splats, int64_t most) {
  std::vector<int64_t> opaque, some;
  for (int64_t i = 0; i < splats.count; ++i)
    if (splats.opacity_logit[i] >= kOpaqueLogit) opaque.push_back(i);
  const int64_t count = std::min(most, std::ssize(opaque));
  for (int64_t k = 0; k < count; ++k)
    some.push_back(opaque[static_cast<size_t>(k * std::ssize(opaque) / count)]);
  return some;
}

}  // namespace regrade
