// A field on a CUDA device, of voxels or of splats, whose colours a network changes.
#pragma once

#include <memory>

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/radiance_field.h"
#include "kernels/splats/cuda/device_splat_weigher.h"
#include "stylize/field/network_row.h"

namespace regrade {

// Of splats only records, without densities, frame and background are there.
struct StyleFieldView : DeviceGridView {
  int basis = 9;
  const float* mean = nullptr;  // [N, 3], of splats: world
};

struct DeviceStyleField {
  DeviceGrid grid;                             // see StyleFieldView
  std::unique_ptr<DeviceSplatWeigher> splats;  // null of voxels

  NetworkRow row() const { return RowOf(grid.basis); }
  StyleFieldView view() const {
    return {grid.view(), grid.basis,
            splats != nullptr ? splats->splats().mean.data() : nullptr};
  }
};

// Voxels or splats, and texels of the background: what the network maps.
inline int64_t NumMapped(const DeviceStyleField& field) {
  return field.grid.num_voxels() + field.grid.spheres.num_texels();
}

// Throws Error(kResources) without a device, or where its memory is too small.
DeviceStyleField UploadStyleField(const RadianceField& field);
Appearance DownloadAppearance(const DeviceStyleField& field);

}  // namespace regrade
