// The difference of a picture from a photo, and its gradient, on a CUDA device; see
// kernels/image/picture_loss.h, of which this is the fast version there.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/image/picture_loss.h"

namespace regrade {

// Its memory, 12 floats a pixel, is kept between calls.
class DevicePictureLoss {
 public:
  // Pointers are to device memory; see Compare. Writes d_picture, and adds to the sums.
  void Compare(int width, int height, const uint16_t* photo, const uint8_t* masked,
               const float* picture, float lambda, float* d_picture);
  // The sums since the last call; waits. Blocks of pixels are summed in double, in an order
  // that does not depend on the device's scheduling.
  PictureSums TakeSums();

 private:
  DeviceBuffer<float> slopes_;  // [3, H, W, 3]: by P, Q and R
  DeviceBuffer<PictureSums> of_block_;
  DeviceBuffer<PictureSums> sums_;  // [1]
};

}  // namespace regrade
