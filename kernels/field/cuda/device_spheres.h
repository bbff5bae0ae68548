// Background layers on a CUDA device, in the layout of FastSpheres, with the state of a fit.
// The parity table compares it with background_spheres.h and sphere_variation.h.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/field/packed_grid.h"

namespace regrade {

// A non-owning view for kernels.
struct DeviceSpheresView {
  int layers = 0;  // L; 0: no background spheres
  int resolution = 0;
  const int32_t* links = nullptr;            // [2R, R]
  const int32_t* place_of_column = nullptr;  // [columns]: a column's index in links
  float* texels = nullptr;                   // [columns, L, 4]: colour, density

  HD bool on() const { return layers > 0; }
};

struct DeviceSpheres {
  int layers = 0;
  int resolution = 0;
  DeviceBuffer<int32_t> links, place_of_column;
  DeviceBuffer<float> texels;
  // Only of a field that is being fitted, shaped as texels; the gradient is 64-bit integers if
  // sums are exact (AddExact in gradient_view.h).
  DeviceBuffer<float> gradient, second_moment;

  bool on() const { return layers > 0; }
  int64_t num_texels() const { return texels.size() / 4; }
  DeviceSpheresView view() const;
};

// `second_moment` has the texels' shape, or is empty for zeros.
DeviceSpheres UploadSpheres(const FastSpheres& spheres, bool fitting,
                            const Buffer<float>& second_moment, bool exact_sums);
FastSpheres DownloadSpheres(const DeviceSpheres& spheres);
// [texels, 4], of a field that is being fitted.
Buffer<float> DownloadGradient(const DeviceSpheres& spheres, bool exact_sums);

}  // namespace regrade
