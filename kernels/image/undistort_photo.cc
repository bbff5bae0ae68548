#include "kernels/image/undistort_photo.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Where the camera's photo shows image point (u, v) of a lens without distortion.
struct Place {
  double u = 0, v = 0;
  bool in_front = false;
};

Place PlaceOf(const Camera& own, const Camera& plain, double u, double v) {
  Place place;
  place.in_front = own.Project(plain.CameraRay(u, v), &place.u, &place.v);
  return place;
}

void CubicWeights(double t, double* w) {
  w[0] = t * (-0.5 + t * (1 - 0.5 * t));
  w[1] = 1 + t * t * (-2.5 + 1.5 * t);
  w[2] = t * (0.5 + t * (2 - 1.5 * t));
  w[3] = t * t * (-0.5 + 0.5 * t);
}

// Of one channel; x and y as in kernels/image/warp.h.
float SampleCubic(const Image& image, double x, double y, int channel) {
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  double across[4], down[4], sum = 0;
  CubicWeights(x - x0, across);
  CubicWeights(y - y0, down);
  float least = std::numeric_limits<float>::infinity(), most = -least;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      const float value = image.at(std::clamp(x0 - 1 + i, 0, image.width - 1),
                                   std::clamp(y0 - 1 + j, 0, image.height - 1))[channel];
      sum += across[i] * down[j] * value;
      if (i == 0 || i == 3 || j == 0 || j == 3) continue;
      least = std::min(least, value);
      most = std::max(most, value);
    }
  return std::isfinite(sum) ? std::clamp(static_cast<float>(sum), least, most)
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
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
#pragma omp parallel for schedule(dynamic, 4)
  for (int y = 0; y < photo.height; ++y) {
    Place next = PlaceOf(own, plain, 0.5, y + 0.5);
    for (int x = 0; x < photo.width; ++x) {
      const Place at = next, below = PlaceOf(own, plain, x + 0.5, y + 1.5);
      next = PlaceOf(own, plain, x + 1.5, y + 0.5);
      const double area = (next.u - at.u) * (below.v - at.v) -
                          (next.v - at.v) * (below.u - at.u);  // negative where it folds over
      const bool seen = at.in_front && area > 0 && at.u >= 0 && at.v >= 0 &&
                        at.u <= photo.width && at.v <= photo.height;
      for (int c = 0; c < photo.channels; ++c)
        result.at(x, y)[c] = seen ? SampleCubic(photo, at.u - 0.5, at.v - 0.5, c) : kNone;
    }
  }
  return result;
}

}  // namespace regrade
