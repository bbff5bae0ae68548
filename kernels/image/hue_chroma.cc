#include "kernels/image/hue_chroma.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/color_spaces.h"
#include "kernels/image/row_sum.h"
#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

// Linear light of values from 0 to 1, to the bit as LinearFromSrgb gives it. Frames have 256
// different values: the last value near each of them is kept.
class LinearLight {
 public:
  LinearLight() { std::ranges::fill(encoded_, -1.0f); }

  double operator()(float encoded) {
    const float value = std::clamp(encoded, 0.0f, 1.0f);
    const int level = static_cast<int>(255 * value + 0.5f);
    if (encoded_[level] != value) {
      encoded_[level] = value;
      linear_[level] = LinearFromSrgb(static_cast<double>(value));
    }
    return linear_[level];
  }

 private:
  std::array<float, 256> encoded_;
  std::array<double, 256> linear_{};
};

}  // namespace

HueChroma& HueChroma::operator+=(const HueChroma& o) {
  sum_a_ += o.sum_a_;
  sum_b_ += o.sum_b_;
  sum_chroma_ += o.sum_chroma_;
  count_ += o.count_;
  return *this;
}

void HueChroma::Add(const Image& image, const Image* mask) {
  if (mask != nullptr) {
    REGRADE_CHECK(mask->SameSize(image));
    REGRADE_CHECK_EQ(mask->channels, 1);
  }
  *this += SumOverRows(image.height, [&](int y) {
    HueChroma row;
    static thread_local LinearLight linear;
    for (int x = 0; x < image.width; ++x) {
      if (mask != nullptr && !(*mask->at(x, y) > 0.5f)) continue;
      const float* p = image.at(x, y);
      Vec3d lab;
      if (image.channels >= 3) {
        if (!AllFinite(Vec3f{p[0], p[1], p[2]})) continue;
        lab = LabFromLinear({linear(p[0]), linear(p[1]), linear(p[2])});
      }
      row.sum_a_ += lab.y;
      row.sum_b_ += lab.z;
      row.sum_chroma_ += std::sqrt(lab.y * lab.y + lab.z * lab.z);
      ++row.count_;
    }
    return row;
  });
}

std::optional<double> HueChroma::MeanChroma() const {
  if (count_ == 0) return std::nullopt;
  return sum_chroma_ / static_cast<double>(count_);
}

std::optional<double> HueChroma::HueStd() const {
  if (count_ == 0 || !(*MeanChroma() >= 1e-4)) return std::nullopt;
  const double r = std::min(1.0, std::hypot(sum_a_, sum_b_) / sum_chroma_);
  return std::sqrt(-2 * std::log(std::max(r, 1e-12)));  // finite (7.4) for hues that cancel
}

}  // namespace regrade
