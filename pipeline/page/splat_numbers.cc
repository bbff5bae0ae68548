#include "pipeline/page/splat_numbers.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

#include "kernels/base/error.h"
#include "kernels/base/morton.h"
#include "kernels/splats/extent.h"

namespace regrade {
namespace {

constexpr int64_t kCoarsePart = 6;  // of all splats, one of so many

int16_t RoundedNumber(double value) {
  const double most = kMaxNumber;
  return static_cast<int16_t>(std::floor(std::clamp(value, -most, most) + 0.5));
}

uint64_t Morton(const SplatNumbers& numbers) {
  constexpr int kBegin = kMaxNumber + 1;
  return KeyOf({numbers[0] + kBegin, numbers[1] + kBegin, numbers[2] + kBegin});
}

double Contribution(const SplatNumbers& numbers) {
  int far = 0;
  for (size_t a = 0; a < 3; ++a) far = std::max(far, std::abs(int{numbers[a]}));
  std::array<int, 3> log = {numbers[3], numbers[4], numbers[5]};
  std::ranges::sort(log);
  // Beyond the box, at 1, a place m is 1 / (2 - m) half extents away.
  const double distance = 1 / (2 - std::max(1.0, far * kPositionStep));
  return numbers[9] * std::exp((log[1] + log[2]) * kLogScaleStep) / (distance * distance);
}

}  // namespace

SplatNumbers NumbersOfSplat(const Splat<float>& splat, const GridFrame& box) {
  double p[3], farthest = 0;
  for (int a = 0; a < 3; ++a) {
    p[a] = (double{splat.mean[a]} - double{box.center[a]}) / double{box.radius[a]};
    farthest = std::max(farthest, std::abs(p[a]));
  }
  const double shrunk = farthest <= 1 ? 1 : (2 - 1 / farthest) / farthest;
  float unit[4];
  UnitQuaternion(splat.quaternion, unit);
  // The half turn that brings the largest component to the front: a product with i, j or k.
  const float w = unit[0], x = unit[1], y = unit[2], z = unit[3];
  const float turned[4][4] = {{w, x, y, z}, {x, -w, -z, y}, {y, z, -w, -x}, {z, -y, x, -w}};
  int front = 0;
  for (int a = 1; a < 4; ++a)
    if (std::abs(unit[a]) > std::abs(unit[front])) front = a;
  const double sign = turned[front][0] < 0 ? -1 : 1;
  SplatNumbers numbers;
  for (size_t a = 0; a < 3; ++a) {
    const int i = static_cast<int>(a);
    numbers[a] = RoundedNumber(p[a] * shrunk / kPositionStep);
    numbers[3 + a] = RoundedNumber(
        std::clamp(double{splat.log_scale[i]}, -kMaxLogScale, kMaxLogScale) / kLogScaleStep);
    numbers[6 + a] = RoundedNumber(sign * double{turned[front][a + 1]} / kRotationStep);
  }
  const double opacity = std::exp(LogSigmoid(double{splat.opacity_logit}));
  numbers[9] = std::min<int16_t>(RoundedNumber(opacity * kOpacitySteps), kOpacitySteps - 1);
  return numbers;
}

Splat<float> SplatOfNumbers(const SplatNumbers& numbers, const GridFrame& box) {
  const auto refuse = [](const char* what) { throw InputError(what, "splats"); };
  Splat<float> splat;
  double p[3], farthest = 0, squared = 0;
  for (size_t a = 0; a < 3; ++a) {
    p[a] = numbers[a] * kPositionStep;
    farthest = std::max(farthest, std::abs(p[a]));
    const double log_scale = numbers[3 + a] * kLogScaleStep;
    if (std::abs(log_scale) > kMaxLogScale + kLogScaleStep) refuse("a scale is out of range");
    splat.log_scale[static_cast<int>(a)] = static_cast<float>(log_scale);
    const double component = numbers[6 + a] * kRotationStep;
    splat.quaternion[a + 1] = static_cast<float>(component);
    squared += component * component;
  }
  if (!(squared < 1)) refuse("a rotation is out of range");
  if (numbers[9] < kLeastOpacity || numbers[9] >= kOpacitySteps)
    refuse("an opacity is out of range");
  const double grown = farthest <= 1 ? 1 : 1 / (2 - farthest) / farthest;
  for (int a = 0; a < 3; ++a)
    splat.mean[a] =
        static_cast<float>(double{box.center[a]} + double{box.radius[a]} * p[a] * grown);
  splat.quaternion[0] = static_cast<float>(std::sqrt(1 - squared));
  const double opacity = 1.0 * numbers[9] / kOpacitySteps;
  splat.opacity_logit = static_cast<float>(std::log(opacity / (1 - opacity)));
  return splat;
}

std::vector<EarlierRecords> EarlierSplats(int64_t count, int64_t coarse) {
  std::vector<EarlierRecords> earlier(static_cast<size_t>(count), {-1, -1, -1});
  for (int64_t i = 0; i < count; ++i) {
    const int64_t first = i < coarse ? 0 : coarse;
    for (int64_t k = 0; k < 3 && i - k > first; ++k)
      earlier[static_cast<size_t>(i)][static_cast<size_t>(k)] = static_cast<int32_t>(i - k - 1);
  }
  return earlier;
}

SplatOrder OrderOfSplats(const Geometry& geometry) {
  struct Key {
    double contribution;
    uint64_t morton;
    int64_t splat;
  };
  std::vector<Key> keys;
  const SplatGeometry& own = geometry.splats;
  const SplatsView<float> splats = {own.mean.data(), own.log_scale.data(),
                                    own.quaternion.data(), own.opacity_logit.data()};
  for (int64_t i = 0; i < geometry.num_voxels(); ++i) {
    const SplatNumbers numbers = NumbersOfSplat(splats[i], geometry.frame);
    if (numbers[9] >= kLeastOpacity)
      keys.push_back({Contribution(numbers), Morton(numbers), i});
  }
  const auto along = [](const Key& k) { return std::tuple(k.morton, k.splat); };
  SplatOrder order;
  order.coarse = std::ssize(keys) / kCoarsePart;
  std::ranges::sort(keys, std::less(), [&along](const Key& k) {
    return std::tuple_cat(std::tuple(-k.contribution), along(k));
  });
  const auto middle = keys.begin() + order.coarse;
  std::ranges::sort(keys.begin(), middle, std::less(), along);
  std::ranges::sort(middle, keys.end(), std::less(), along);
  for (const Key& key : keys) order.splat.push_back(key.splat);
  order.earlier = EarlierSplats(std::ssize(keys), order.coarse);
  return order;
}

}  // namespace regrade
