// Photos and cameras on a CUDA device, for drawing training rays and generating a view's rays.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/device/device_memory.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Input for one view. `color` [H, W, 3] unorm16 may be null if only rays are needed.
struct DeviceViewSource {
  Vec3f origin;             // field
  Mat3f world_from_camera;  // rotation
  NdcSpace ndc;
  int width = 0, height = 0;  // pixels
  int direction_map = 0;
  const uint16_t* color = nullptr;
  // Pixels y W + x from which rays are drawn, if some are excluded.
  const int32_t* drawn = nullptr;
  int32_t num_drawn = 0;  // 0: all
};

class DeviceViews {
 public:
  // direction_maps: [H, W] unit directions in the camera's frame, one per lens and size.
  DeviceViews(const std::vector<std::vector<Vec3f>>& direction_maps,
              const std::vector<DeviceViewSource>& views);

  // The same rays and targets as TrainingRays::Draw with patches of one pixel, unordered.
  void Draw(uint64_t seed, uint64_t step, int64_t n, Ray* rays, Vec3f* targets) const;
  // Rays of every `stride`-th pixel of a view, row by row; returns their number. rays may be
  // null to count only.
  int64_t RaysOf(int view, int stride, Ray* rays) const;
  int num_views() const { return static_cast<int>(host_views_.size()); }

  // A view as kernels see it.
  struct View {
    Vec3f origin;
    Mat3f world_from_camera;
    NdcSpace ndc;
    int width, height;
    int64_t direction_map, color, drawn;  // first elements
    int32_t num_drawn;
  };

 private:
  std::vector<View> host_views_;
  DeviceBuffer<View> views_;
  DeviceBuffer<Vec3f> directions_;
  DeviceBuffer<uint16_t> colors_;
  DeviceBuffer<int32_t> drawn_;
};

}  // namespace regrade
