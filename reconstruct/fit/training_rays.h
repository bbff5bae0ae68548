// The pool of training rays: pixels of all training views (DrawnPixels), drawn by counter so
// that batches depend neither on the number of threads nor on a resume.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/cuda/device_views.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/point_observations.h"

namespace regrade {

// Indices y W + x, ascending, of `photo` (3 channels, sRGB): without the masked pixels, which
// have a non-finite value.
std::vector<int32_t> DrawnPixels(const Image& photo);

// `photo` has the camera's size, 3 channels, sRGB. Pixels with a non-finite value are masked:
// no ray is drawn there. Cameras are in the field's frame.
struct TrainingView {
  Camera camera;
  const Image* photo = nullptr;
  std::vector<SeenPoint> points = {};  // that the photo saw; used by fits of splats
};

class TrainingRays {
 public:
  // Copies the pixels (6 bytes each: unorm16, exact for 8-bit photos) and stores one direction
  // map per lens. Throws Error(kInput) for a view without an unmasked pixel.
  explicit TrainingRays(const std::vector<TrainingView>& views);

  int64_t num_rays() const { return total_; }
  int num_views() const { return static_cast<int>(views_.size()); }
  Vec3f mean_color() const { return mean_color_; }

  // Fills rays and targets with `patches` squares of patch x patch pixels, the same number
  // (+-1) from every view, ordered by view and position so that neighbours share voxels. A
  // masked pixel of a square is replaced by an unmasked one of the square.
  void Draw(uint64_t seed, uint64_t step, int patches, int patch, std::vector<Ray>* rays,
            std::vector<Vec3f>* targets) const;

  Ray RayOf(int view, int x, int y) const;
  // Copies all views to a CUDA device. Throws Error(kResources) if it does not fit, or without
  // CUDA.
  DeviceViews ToDevice() const;
  const Camera& camera(int view) const { return views_[static_cast<size_t>(view)].camera; }

 private:
  struct StoredView {
    Camera camera;
    int direction_map;
    Vec3f origin;
    Mat3f world_from_camera;
    std::vector<uint16_t> color;  // [H, W, 3]
    std::vector<int32_t> drawn;   // DrawnPixels; empty if these are all
    bool IsMasked(int64_t pixel) const;
  };
  std::vector<StoredView> views_;
  std::vector<std::vector<Vec3f>>
      direction_maps_;  // [H, W] unit directions in the camera's frame
  int64_t total_ = 0;
  Vec3f mean_color_{};
};

}  // namespace regrade
