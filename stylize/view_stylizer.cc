#include "stylize/view_stylizer.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

int64_t CountNotFinite(const Image& image, ExitCode code, const std::string& where) {
  int64_t count = 0;
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    const float* p = &image.pixels[i * image.channels];
    if (!std::all_of(p, p + image.channels, [](float v) { return std::isfinite(v); })) ++count;
  }
  if (count * 100 > image.num_pixels())
    throw Error(code,
                std::to_string(count) + " of " + std::to_string(image.num_pixels()) +
                    " pixels are not finite numbers",
                where, "at most 1 % may be");
  return count;
}

std::string Shape(const Image& image) {
  return std::to_string(image.width) + "x" + std::to_string(image.height) + " with " +
         std::to_string(image.channels) + " channels";
}

}  // namespace

int64_t CountNotFinite(const Image& image, const std::string& where) {
  return CountNotFinite(image, ExitCode::kInput, where);
}

int64_t CheckStyledView(const Image& view, const Image& styled, const std::string& where) {
  if (!view.SameSize(styled) || view.channels != styled.channels)
    throw Error(ExitCode::kExternalProgram,
                "the styled view is " + Shape(styled) + ", the view " + Shape(view), where,
                "a 2D method must keep the size of its view");
  return CountNotFinite(styled, ExitCode::kExternalProgram, where);
}

}  // namespace regrade
