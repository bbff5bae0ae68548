#include "kernels/image/hue_chroma.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

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

// Lab and chroma of a colour, to the bit as LabFromLinear gives them: neighbouring pixels and
// frames often have the same, and three cube roots cost more than finding them again.
class LabColours {
  static constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

 public:
  struct Entry {
    std::array<float, 3> rgb{kNan, kNan, kNan};  // which equals nothing
    Vec3d lab;
    double chroma = 0;
  };

  LabColours() : entries_(kEntries) {}

  const Entry& operator()(float red, float green, float blue) {
    const std::array<float, 3> rgb{red, green, blue};
    std::array<uint32_t, 3> bits;
    std::memcpy(bits.data(), rgb.data(), sizeof(bits));
    const uint32_t mixed =
        (bits[0] * 0x9e3779b1u ^ bits[1] * 0x85ebca77u ^ bits[2] * 0xc2b2ae3du) >> kShift;
    Entry& entry = entries_[mixed];
    if (entry.rgb != rgb) {
      entry.rgb = rgb;
      entry.lab = LabFromLinear({linear_(red), linear_(green), linear_(blue)});
      entry.chroma = std::sqrt(entry.lab.y * entry.lab.y + entry.lab.z * entry.lab.z);
    }
    return entry;
  }

 private:
  static constexpr int kShift = 19;  // 8192 entries, 0.4 MB a thread
  static constexpr size_t kEntries = size_t{1} << (32 - kShift);
  LinearLight linear_;
  std::vector<Entry> entries_;
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
    static thread_local LabColours colours;
    for (int x = 0; x < image.width; ++x) {
      if (mask != nullptr && !(*mask->at(x, y) > 0.5f)) continue;
      const float* p = image.at(x, y);
      if (image.channels >= 3) {
        if (!AllFinite(Vec3f{p[0], p[1], p[2]})) continue;
        const LabColours::Entry& colour = colours(p[0], p[1], p[2]);
        row.sum_a_ += colour.lab.y;
        row.sum_b_ += colour.lab.z;
        row.sum_chroma_ += colour.chroma;
      }
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
