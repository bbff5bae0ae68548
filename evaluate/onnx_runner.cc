#include "evaluate/onnx_runner.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

// [3, height, width] from -1 to 1, or `as_given`; non-finite values become black.
std::vector<float> ValuesOf(const Image& image, bool as_given) {
  std::vector<float> values;
  values.reserve(3 * static_cast<size_t>(image.num_pixels()));
  for (int c = 0; c < 3; ++c)
    for (int64_t p = 0; p < image.num_pixels(); ++p) {
      const float value = image.pixels[p * image.channels + (image.channels >= 3 ? c : 0)];
      const float given = std::isfinite(value) ? value : 0.0f;
      values.push_back(as_given ? given : 2 * std::clamp(given, 0.0f, 1.0f) - 1);
    }
  return values;
}

}  // namespace

OnnxArray OnnxRunner::Run(const Inputs& inputs, bool as_given) const {
  std::vector<std::vector<float>> values;
  std::vector<OnnxModel::Input> arrays;
  for (const auto& [name, picture] : inputs) {
    if (!picture->SameSize(*inputs.front().second))
      Refuse("two pictures differ in size", "use pictures of one size");
    values.push_back(ValuesOf(*picture, as_given));
    arrays.push_back({name, {1, 3, picture->height, picture->width}, values.back().data()});
  }
  return std::move(model_.Run(arrays, {}, expected_).front());
}

}  // namespace regrade
