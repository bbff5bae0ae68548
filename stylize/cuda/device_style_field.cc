#include "stylize/cuda/device_style_field.h"

#include "kernels/field/packed_grid.h"
#include "kernels/splats/splat_field.h"

namespace regrade {
namespace {

// Lists of splats take at most this part of the memory that is free.
constexpr int64_t kPartForLists = 4;

constexpr int64_t BytesOf(int64_t floats) { return floats * int64_t{sizeof(float)}; }

}  // namespace

DeviceStyleField UploadStyleField(const RadianceField& field) {
  DeviceStyleField device;
  if (!field.geometry->splats.on()) {
    device.grid = UploadGrid(MakeFastGrid(field));
    return device;
  }
  DeviceGrid& grid = device.grid;
  grid.frame = field.geometry->frame;
  grid.basis = field.appearance.basis;
  grid.background = field.background;
  const int64_t n = field.geometry->num_voxels(), row = BytesOf(field.appearance.stride());
  grid.records = DeviceBuffer<float>(n * grid.stride(), "colours of splats");
  grid.records.Zero();
  const DeviceBuffer<float> sh =
      DeviceBuffer<float>::Of(field.appearance.sh, "colours of splats");
  DeviceCopyRows(grid.records.data(), BytesOf(grid.stride()), sh.data(), row, row, n);
  device.splats = std::make_unique<DeviceSplatWeigher>(
      SplatsWithoutColors(field.geometry->splats), SplatOptionsOf(field),
      ReadDeviceStatus().free_bytes / kPartForLists);
  return device;
}

Appearance DownloadAppearance(const DeviceStyleField& field) {
  const DeviceGrid& grid = field.grid;
  if (field.splats == nullptr) return ToRadianceField(DownloadGrid(grid)).appearance;
  Appearance appearance;
  appearance.basis = grid.basis;
  const int64_t n = grid.num_voxels(), row = BytesOf(appearance.stride());
  const DeviceBuffer<float> sh(n * appearance.stride(), "colours of splats");
  DeviceCopyRows(sh.data(), row, grid.records.data(), BytesOf(grid.stride()), row, n);
  appearance.sh = sh.ToHost();
  return appearance;
}

}  // namespace regrade
