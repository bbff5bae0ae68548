#include "pipeline/page/residual_codec.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/value_codec.h"

namespace regrade {
namespace {

int16_t Byte(float part) {
  return static_cast<int16_t>(std::floor(std::clamp(double{part}, 0.0, 1.0) * 255 + 0.5));
}

// (code - 128) * scale.
uint8_t CodeOf(double value, double scale) {
  return static_cast<uint8_t>(std::floor(std::clamp(value / scale, -127.0, 127.0) + 128.5));
}

}  // namespace

PageResidual EncodeResidual(const StyleLayers& layers,
                            const std::vector<EarlierRecords>& earlier) {
  const size_t n = earlier.size();
  PageResidual page;
  page.rounded = layers;
  std::vector<int16_t> numbers;
  JsonValue::Array scales;
  if (const std::vector<Vec3f>& color = layers.residual.color; !color.empty()) {
    REGRADE_CHECK_EQ(color.size(), n);
    for (int c = 0; c < 3; ++c) {
      float largest = 0;
      for (const Vec3f& x : color) largest = std::max(largest, std::abs(x[c]));
      const double scale = largest > 0 ? double{largest} / kSh0 / 127 : 1;
      scales.emplace_back(scale);
      for (size_t i = 0; i < n; ++i) {
        const int code = CodeOf(double{color[i][c]} / kSh0, scale) - 128;
        numbers.push_back(static_cast<int16_t>(code));
        page.rounded.residual.color[i][c] = static_cast<float>(code * scale * kSh0);
      }
    }
    for (int c = 0; c < 3 && !layers.residual.view_scale.empty(); ++c)
      for (size_t i = 0; i < n; ++i) {
        const int16_t code = Byte(layers.residual.view_scale[i][c]);
        numbers.push_back(static_cast<int16_t>(255 - code));
        page.rounded.residual.view_scale[i][c] = static_cast<float>(code) / 255;
      }
  }
  for (size_t i = 0; i < layers.weight.size(); ++i) {
    numbers.push_back(Byte(layers.weight[i]));
    page.rounded.weight[i] = static_cast<float>(numbers.back()) / 255;
  }
  page.header =
      JsonValue::Object{{"scale", scales.empty() ? JsonValue() : JsonValue(std::move(scales))},
                        {"view", !layers.residual.view_scale.empty()},
                        {"weight", !layers.weight.empty()}};
  page.packed = Deflate(PackNumbers(numbers, static_cast<int>(numbers.size() / n), earlier));
  return page;
}

void ApplyLayers(const StyleLayers& layers, const std::vector<int64_t>& splats,
                 const RadianceField& source, RadianceField* styled) {
  const int stride = styled->appearance.stride(), basis = styled->appearance.basis;
  const int own = source.appearance.basis;  // what it lacks counts as 0
  for (size_t i = 0; i < splats.size(); ++i) {
    float* const sh = styled->appearance.sh.data() + splats[i] * stride;
    const float* const before = source.appearance.sh.data() + splats[i] * 3 * own;
    for (int j = 0; j < stride; ++j) {
      const int c = j / basis, k = j % basis;
      if (!layers.residual.color.empty() && k == 0)
        sh[j] += layers.residual.color[i][c] / static_cast<float>(kSh0);
      if (!layers.residual.view_scale.empty() && k != 0)
        sh[j] *= layers.residual.view_scale[i][c];
      if (!layers.weight.empty())
        sh[j] = (1 - layers.weight[i]) * (k < own ? before[c * own + k] : 0.0f) +
                layers.weight[i] * sh[j];
    }
  }
  if (!layers.weight.empty()) styled->background = source.background;
}

}  // namespace regrade
