#include "kernels/field/cuda/device_spheres.h"

#include "kernels/field/cuda/gradient_view.h"

namespace regrade {

DeviceSpheresView DeviceSpheres::view() const {
  return {layers, resolution, links.data(), place_of_column.data(), texels.data()};
}

DeviceSpheres UploadSpheres(const FastSpheres& spheres, bool fitting,
                            const Buffer<float>& second_moment, bool exact_sums) {
  DeviceSpheres device;
  if (!spheres.on()) return device;
  device.layers = spheres.layers;
  device.resolution = spheres.resolution;
  device.links = DeviceBuffer<int32_t>::Of(spheres.links, "links of the background");
  Buffer<int32_t> places(spheres.num_texels() / spheres.layers);
  for (int64_t at = 0; at < spheres.links.size(); ++at)
    if (spheres.links[at] >= 0) places[spheres.links[at]] = static_cast<int32_t>(at);
  device.place_of_column = DeviceBuffer<int32_t>::Of(places, "background columns");
  device.texels = DeviceBuffer<float>::Of(spheres.texels, "background texels");
  if (!fitting) return device;
  const int64_t values = spheres.texels.size();
  device.gradient =
      DeviceBuffer<float>((exact_sums ? 2 : 1) * values, "gradients of the background");
  device.gradient.Zero();
  device.second_moment = DeviceBuffer<float>(values, "moments of the background");
  if (second_moment.size() == values)
    device.second_moment.CopyIn(second_moment.data(), values);
  else
    device.second_moment.Zero();
  return device;
}

FastSpheres DownloadSpheres(const DeviceSpheres& device) {
  FastSpheres spheres;
  if (!device.on()) return spheres;
  spheres.layers = device.layers;
  spheres.resolution = device.resolution;
  spheres.links = device.links.ToHost();
  spheres.texels = device.texels.ToHost();
  return spheres;
}

Buffer<float> DownloadGradient(const DeviceSpheres& spheres, bool exact_sums) {
  if (!exact_sums) return spheres.gradient.ToHost();
  Buffer<int64_t> units(spheres.texels.size());
  DeviceCopyOut(units.data(), spheres.gradient.data(), units.size() * int64_t{sizeof(int64_t)});
  Buffer<float> gradient(units.size());
  for (int64_t i = 0; i < units.size(); ++i)
    gradient[i] = static_cast<float>(static_cast<double>(units[i]) * kExactUnit);
  return gradient;
}

}  // namespace regrade
