// The photos of a splat fit: undistorted, in steps of 1 / 65535, at several sizes.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "kernels/splats/seen_depth.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

struct SplatPhoto {
  Camera camera;                  // a pinhole
  std::vector<uint16_t> color;    // [H, W, 3] sRGB
  std::vector<uint8_t> masked;    // [H, W]: 1 where a pixel is; empty if none is
  std::vector<SeenDepth> depths;  // of points that the photo saw, at most one a pixel
};

class SplatPhotos {
 public:
  // Undistorts what has a lens; `shrink`: sizes are divided by it. Pixels that are not finite
  // are masked, and a smaller pixel is if one of those that it covers is. Throws Error(kInput)
  // for a photo without an unmasked pixel, Error(kUsage) for cameras in device coordinates.
  explicit SplatPhotos(const std::vector<TrainingView>& views, double shrink = 1);
  SplatPhotos() = default;
  // One more; the view's photo need not stay. Throws as the constructor.
  void Add(const TrainingView& view, double shrink = 1);

  int count() const { return static_cast<int>(photos_.size()); }
  const SplatPhoto& operator[](int i) const { return photos_[static_cast<size_t>(i)]; }
  int64_t num_pixels() const;
  Vec3f mean_color() const;  // sRGB, of all pixels that are not masked
  // Tangent of the angle of a pixel; below 0 if the focal lengths differ by more than 5 %.
  float pixel() const;

 private:
  std::vector<SplatPhoto> photos_;
};

}  // namespace regrade
