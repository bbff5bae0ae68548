#include "stylize/image/view_stylizer.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

bool IsFinite(const Image& image, int64_t pixel) {
  const float* p = &image.pixels[pixel * image.channels];
  return std::all_of(p, p + image.channels, [](float v) { return std::isfinite(v); });
}

int64_t CountNotFinite(const Image& image, ExitCode code, const std::string& where) {
  int64_t count = 0;
  for (int64_t i = 0; i < image.num_pixels(); ++i)
    if (!IsFinite(image, i)) ++count;
  if (count * 100 > image.num_pixels())
    throw Error(code,
                Concat(count, " of ", image.num_pixels(), " pixels are not finite numbers"),
                where, "at most 1 % may be");
  return count;
}

std::string Shape(const Image& image) {
  return Concat(image.width, "x", image.height, " with ", image.channels, " channels");
}

}  // namespace

int64_t CountNotFinite(const Image& image, const std::string& where) {
  return CountNotFinite(image, ExitCode::kInput, where);
}

int64_t CheckStyledView(const Image& view, const Image& styled, const std::string& where) {
  if (!view.SameSize(styled) || view.channels != styled.channels)
    throw ProgramError("the styled view is " + Shape(styled) + ", the view " + Shape(view),
                       where, "a 2D method must keep the size of its view");
  return CountNotFinite(styled, ExitCode::kExternalProgram, where);
}

Image Colors(const Image& view) {
  Image colors(view.width, view.height);
  for (int64_t i = 0; i < view.num_pixels(); ++i) {
    const float* p = &view.pixels[i * view.channels];
    const bool finite = IsFinite(view, i);
    for (int c = 0; c < 3; ++c)
      colors.pixels[3 * i + c] =
          finite ? std::clamp(p[view.channels < 3 ? 0 : c], 0.0f, 1.0f) : 0.5f;
  }
  return colors;
}

Image WithColors(const Image& view, const Image& colors) {
  REGRADE_CHECK(view.SameSize(colors) && colors.channels == 3);
  Image result = view;
  for (int64_t i = 0; i < view.num_pixels(); ++i) {
    if (!IsFinite(view, i)) continue;
    const float* p = &colors.pixels[3 * i];
    float* q = &result.pixels[i * view.channels];
    if (view.channels < 3)
      q[0] = (p[0] + p[1] + p[2]) / 3;
    else
      std::copy_n(p, 3, q);
  }
  return result;
}

}  // namespace regrade
