#include "kernels/render/device_ray_weigher.h"

#include <numeric>
#include <vector>

namespace regrade {

RayWeights DeviceRayWeigher::Weigh(const ViewRays& rays, int64_t begin, int64_t end) {
  const int64_t n = end - begin;
  DeviceSplatSamples device;
  weigher_.Weigh({{&rays, begin, end}}, n, min_weight, &device);
  std::vector<SplatSample> samples(static_cast<size_t>(device.most));
  device.sample.CopyOut(samples.data(), device.most);
  RayWeights result;
  result.transmittance.resize(static_cast<size_t>(n));
  device.transmittance.CopyOut(result.transmittance.data(), n);
  // By ray; those of a ray are in order.
  result.first.assign(static_cast<size_t>(n) + 1, 0);
  for (const SplatSample& sample : samples) ++result.first[static_cast<size_t>(sample.ray) + 1];
  std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
  std::vector<int64_t> next(result.first.begin(), result.first.end() - 1);
  result.samples.resize(samples.size());
  result.directions.resize(samples.size());
  for (const SplatSample& sample : samples) {
    const size_t to = static_cast<size_t>(next[static_cast<size_t>(sample.ray)]++);
    result.samples[to] = {sample.splat, {0, 0, 0}, sample.weight};
    result.directions[to] = sample.direction;
  }
  return result;
}

}  // namespace regrade
