#include "kernels/splats/cuda/device_splats.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Calls visit(buffer, values a splat, name) for every array.
template <typename Visit>
void ForArrays(DeviceSplats* splats, const Visit& visit) {
  visit(&splats->mean, 3, "means of splats");
  visit(&splats->log_scale, 3, "scales of splats");
  visit(&splats->quaternion, 4, "rotations of splats");
  visit(&splats->opacity_logit, 1, "opacities of splats");
  visit(&splats->sh, 3 * splats->basis, "colours of splats");
}

}  // namespace

DeviceSplats::DeviceSplats(int64_t capacity, int basis) : basis(basis) { Reserve(capacity); }

void DeviceSplats::Reserve(int64_t new_capacity) {
  if (new_capacity <= capacity()) return;
  ForArrays(this, [&](DeviceBuffer<float>* buffer, int values, const char* what) {
    DeviceBuffer<float> grown(new_capacity * values, what);
    if (count > 0)
      DeviceCopyWithin(grown.data(), buffer->data(),
                       count * values * static_cast<int64_t>(sizeof(float)));
    *buffer = std::move(grown);
  });
}

void DeviceSplats::Upload(const SplatsView<float>& splats) {
  if (splats.basis != basis) *this = DeviceSplats(splats.count, splats.basis);
  count = 0;
  Reserve(splats.count);
  count = splats.count;
  background = splats.background;
  mean.CopyIn(splats.mean, 3 * count);
  log_scale.CopyIn(splats.log_scale, 3 * count);
  quaternion.CopyIn(splats.quaternion, 4 * count);
  opacity_logit.CopyIn(splats.opacity_logit, count);
  sh.CopyIn(splats.sh, 3 * basis * count);
}

Splats DeviceSplats::Download() const {
  Splats splats(count, basis);
  splats.background = background;
  mean.CopyOut(splats.mean.data(), 3 * count);
  log_scale.CopyOut(splats.log_scale.data(), 3 * count);
  quaternion.CopyOut(splats.quaternion.data(), 4 * count);
  opacity_logit.CopyOut(splats.opacity_logit.data(), count);
  sh.CopyOut(splats.sh.data(), 3 * basis * count);
  return splats;
}

void DeviceSplats::Zero() {
  ForArrays(this, [&](DeviceBuffer<float>* buffer, int values, const char*) {
    DeviceZero(buffer->data(), count * values * static_cast<int64_t>(sizeof(float)));
  });
}

}  // namespace regrade
