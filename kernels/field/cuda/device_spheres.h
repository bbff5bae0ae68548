// Background layers on a CUDA device, laid out as FastSpheres has them; and what a fit does
// with them. Held to background_spheres.h and sphere_variation.h by the parity table.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/field/packed_grid.h"

namespace regrade {

// What kernels see.
struct DeviceSpheresView {
  int layers = 0;  // L; 0: no background spheres
  int resolution = 0;
  const int32_t* links = nullptr;            // [2R, R]
  const int32_t* place_of_column = nullptr;  // [columns]: where a column lies in links
  float* texels = nullptr;                   // [columns, L, 4]: colour, density

  HD bool on() const { return layers > 0; }
};

struct DeviceSpheres {
  int layers = 0;
  int resolution = 0;
  DeviceBuffer<int32_t> links, place_of_column;
  DeviceBuffer<float> texels;
  // Of a field that is being fitted, as texels; 64-bit integers in the gradient's place where
  // sums are exact (AddExact in gradient_view.h).
  DeviceBuffer<float> gradient, second_moment;

  bool on() const { return layers > 0; }
  int64_t num_texels() const { return texels.size() / 4; }
  DeviceSpheresView view() const;
};

// `second_moment` as texels, or empty for zeros.
DeviceSpheres UploadSpheres(const FastSpheres& spheres, bool fitting,
                            const Buffer<float>& second_moment, bool exact_sums);
FastSpheres DownloadSpheres(const DeviceSpheres& spheres);
// [texels, 4], of spheres that are being fitted.
Buffer<float> DownloadGradient(const DeviceSpheres& spheres, bool exact_sums);

}  // namespace regrade
