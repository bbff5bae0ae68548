#include "kernels/image/undistort_photo.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// The largest |(x, y)| of directions (x, y, 1), up to `most`, within which image points move
// outwards with it; beyond, the lens folds over.
double LargestUnfoldedRadius(const Camera& own, double most) {
  constexpr int kDirections = 32, kSteps = 1000;
  double u0 = 0, v0 = 0;
  own.Project({0, 0, 1}, &u0, &v0);
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 2 * M_PI * d / kDirections;
    double before = -1;
    for (int i = 0; i <= kSteps; ++i) {
      const double r = most * i / kSteps;
      double u, v;
      own.Project({r * std::cos(angle), r * std::sin(angle), 1}, &u, &v);
      const double distance = std::hypot(u - u0, v - v0);
      if (!(distance > before)) {
        most = r;
        break;
      }
      before = distance;
    }
  }
  return most;
}

void CubicWeights(double t, double* w) {
  w[0] = t * (-0.5 + t * (1 - 0.5 * t));
  w[1] = 1 + t * t * (-2.5 + 1.5 * t);
  w[2] = t * (0.5 + t * (2 - 1.5 * t));
  w[3] = t * t * (-0.5 + 0.5 * t);
}

// x and y as in kernels/image/warp.h.
template <int kChannels>
void SampleCubic(const Image& image, double x, double y, float* result) {
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  double across[4], down[4], sum[kChannels] = {};
  CubicWeights(x - x0, across);
  CubicWeights(y - y0, down);
  int column[4];  // of values
  for (int i = 0; i < 4; ++i)
    column[i] = kChannels * std::clamp(x0 - 1 + i, 0, image.width - 1);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float least[kChannels], most[kChannels];
  std::fill_n(least, kChannels, kInfinity);
  std::fill_n(most, kChannels, -kInfinity);
  for (int j = 0; j < 4; ++j) {
    const float* const row = image.at(0, std::clamp(y0 - 1 + j, 0, image.height - 1));
    for (int i = 0; i < 4; ++i) {
      const double weight = across[i] * down[j];
      for (int c = 0; c < kChannels; ++c) sum[c] += weight * row[column[i] + c];
    }
    for (int i = 1; i < 3 && (j == 1 || j == 2); ++i)
      for (int c = 0; c < kChannels; ++c) {
        least[c] = std::min(least[c], row[column[i] + c]);
        most[c] = std::max(most[c], row[column[i] + c]);
      }
  }
  for (int c = 0; c < kChannels; ++c)
    result[c] = std::isfinite(sum[c])
                    ? std::clamp(static_cast<float>(sum[c]), least[c], most[c])
                    : std::numeric_limits<float>::quiet_NaN();
}

}  // namespace

Image UndistortPhoto(const Image& photo, const Camera& camera) {
  REGRADE_CHECK(photo.width == camera.width && photo.height == camera.height);
  if (camera.lens == LensModel::kPinhole) return photo;
  Camera own = camera;  // at the origin
  own.camera_from_world = {};
  own.ndc = {};
  const Camera plain = own.Undistorted();
  Image result(photo.width, photo.height, photo.channels);
  const auto sample = photo.channels == 1   ? SampleCubic<1>
                      : photo.channels == 3 ? SampleCubic<3>
                                            : SampleCubic<4>;
  REGRADE_CHECK(photo.channels == 1 || photo.channels == 3 || photo.channels == 4);
  const double farthest = std::hypot(std::max(plain.cx, plain.width - plain.cx) / plain.fx,
                                     std::max(plain.cy, plain.height - plain.cy) / plain.fy);
  const double fold = LargestUnfoldedRadius(own, farthest * 1.01);
#pragma omp parallel for schedule(dynamic, 4)
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const Vec3d ray = plain.CameraRay(x + 0.5, y + 0.5);
      double u, v;
      const bool seen = ray.x * ray.x + ray.y * ray.y < fold * fold &&
                        own.Project(ray, &u, &v) && u >= 0 && v >= 0 && u <= photo.width &&
                        v <= photo.height;
      if (seen)
        sample(photo, u - 0.5, v - 0.5, result.at(x, y));
      else
        std::fill_n(result.at(x, y), photo.channels, std::numeric_limits<float>::quiet_NaN());
    }
  return result;
}

void FillBeyond(Image* photo) {
  const int w = photo->width, h = photo->height, channels = photo->channels;
  const auto known = [&](int x, int y) { return std::isfinite(*photo->at(x, y)); };
  std::vector<bool> has_one(static_cast<size_t>(h));
  for (int y = 0; y < h; ++y) {
    std::vector<int> from(static_cast<size_t>(w),
                          -1);  // nearest known pixel, first to the left
    for (int x = 0, last = -1; x < w; ++x) {
      if (known(x, y)) last = x;
      from[static_cast<size_t>(x)] = last;
    }
    for (int x = w - 1, next = -1; x >= 0; --x) {
      int& left = from[static_cast<size_t>(x)];
      if (left == x) next = x;
      if (next >= 0 && (left < 0 || next - x < x - left)) left = next;
    }
    has_one[static_cast<size_t>(y)] = from[0] >= 0;
    for (int x = 0; x < w && from[0] >= 0; ++x)
      if (const int at = from[static_cast<size_t>(x)]; at != x)
        std::copy_n(photo->at(at, y), channels, photo->at(x, y));
  }
  for (int y = 0; y < h; ++y) {
    if (has_one[static_cast<size_t>(y)]) continue;
    for (int away = 1; away < h; ++away) {
      const int above = y - away, below = y + away;
      const int source = above >= 0 && has_one[static_cast<size_t>(above)]  ? above
                         : below < h && has_one[static_cast<size_t>(below)] ? below
                                                                            : -1;
      if (source < 0) continue;
      std::copy_n(photo->at(0, source), w * channels, photo->at(0, y));
      break;
    }
  }
}

}  // namespace regrade
