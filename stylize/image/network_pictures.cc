#include "stylize/image/network_pictures.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "stylize/image/guided_filter.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

constexpr int kGuideRadius = 30;               // pixels of the working size
constexpr double kGuideEpsilon = 0.02 * 0.02;  // squared values

std::string ShapeOf(const FeatureMap& map) {
  return Concat(map.channels, " x ", map.height, " x ", map.width);
}

}  // namespace

FeatureMap MapOf(const Image& image) {
  FeatureMap map(3, image.height, image.width);
  for (int c = 0; c < 3; ++c)
    for (int64_t i = 0; i < image.num_pixels(); ++i) map.plane(c)[i] = image.pixels[3 * i + c];
  return map;
}

Image ClippedImageOf(const FeatureMap& map) {
  Image image(map.width, map.height);
  for (int c = 0; c < 3; ++c)
    for (int64_t i = 0; i < image.num_pixels(); ++i)
      image.pixels[3 * i + c] = std::clamp(map.plane(c)[i], 0.0f, 1.0f);
  return image;
}

Image Working(const Image& image, int max_side, int multiple, int smallest) {
  const double scale =
      std::min(1.0, static_cast<double>(max_side) / std::max(image.width, image.height));
  const auto cut = [&](int side) {
    const int scaled = static_cast<int>(side * scale + 0.5);
    return std::max(smallest, scaled / multiple * multiple);
  };
  return Resize(image, cut(image.width), cut(image.height));
}

FeatureMap Padded(const FeatureMap& map, int multiple) {
  REGRADE_CHECK(multiple <= std::min(map.width, map.height));
  const auto up = [&](int side) { return (side + multiple - 1) / multiple * multiple; };
  const auto reflected = [](int i, int side) { return i < side ? i : 2 * (side - 1) - i; };
  FeatureMap padded(map.channels, up(map.height), up(map.width));
  for (int c = 0; c < map.channels; ++c)
    for (int y = 0; y < padded.height; ++y) {
      const float* from =
          map.plane(c) + static_cast<int64_t>(reflected(y, map.height)) * map.width;
      float* to = padded.plane(c) + static_cast<int64_t>(y) * padded.width;
      for (int x = 0; x < padded.width; ++x) to[x] = from[reflected(x, map.width)];
    }
  return padded;
}

FeatureMap Cropped(const FeatureMap& map, int width, int height, int spare,
                   const std::string& path) {
  if (map.width < width || map.height < height || map.width > width + spare ||
      map.height > height + spare)
    CheckShape(map, 3, height, width, path);
  CheckShape(map, 3, map.height, map.width, path);
  FeatureMap part(3, height, width);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      std::copy_n(map.plane(c) + static_cast<int64_t>(y) * map.width, width,
                  part.plane(c) + static_cast<int64_t>(y) * width);
  return part;
}

Image WithEdgesOf(const Image& photo, const Image& small, const Image& styled) {
  return ApplyGuided(FitGuided(small, styled, kGuideRadius, kGuideEpsilon), photo);
}

Image StyledAtWorkingSize(const Image& view, int view_index, int max_side,
                          const std::function<Image(const Image&)>& restyled) {
  CountNotFinite(view, "view " + std::to_string(view_index));
  const Image photo = Colors(view);
  const Image small = Working(photo, max_side, 1);
  const Image styled = restyled(small);
  const bool whole = small.width == photo.width && small.height == photo.height;
  return WithColors(view, whole ? styled : WithEdgesOf(photo, small, styled));
}

Image TrialPicture(int width, int height) {
  Image picture(width, height);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = static_cast<float>(i * 37 % 256) / 255.0f;
  return picture;
}

void CheckShape(const FeatureMap& map, int channels, int height, int width,
                const std::string& path) {
  if (map.channels == channels && map.height == height && map.width == width) return;
  throw ProgramError(
      "it gives " + ShapeOf(map) + ", expected is " + ShapeOf({channels, height, width}), path,
      "take all files of the folder from one conversion");
}

std::string Numbered(const std::string& folder, const std::string& name, int level) {
  return Concat(folder, "/", name, level, ".onnx");
}

}  // namespace regrade
