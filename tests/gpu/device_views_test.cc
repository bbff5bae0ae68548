// Training rays drawn on the device against the host's rule. The test is skipped without a
// device.
#include "kernels/field/cuda/device_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "kernels/base/random.h"

namespace regrade {
namespace {

constexpr int kWidth = 23, kHeight = 17, kPixels = kWidth * kHeight;

// Colours encode view and pixel; directions encode the pixel.
std::vector<uint16_t> ColorsOf(int view) {
  std::vector<uint16_t> colors;
  for (int i = 0; i < kPixels; ++i) {
    colors.push_back(static_cast<uint16_t>(i));
    colors.push_back(static_cast<uint16_t>(view));
    colors.push_back(65535);
  }
  return colors;
}

TEST(DeviceViews, DrawsLikeTheHostAndOnlyAllowedPixels) {
  const DeviceStatus status = ReadDeviceStatus();
  if (!status.found) GTEST_SKIP() << "no GPU: " << status.name;
  std::vector<Vec3f> directions;
  for (int i = 0; i < kPixels; ++i) directions.push_back({static_cast<float>(i), 0, 1});
  std::vector<int32_t> drawn;
  for (int i = 0; i < kPixels; i += 3) drawn.push_back(i);
  std::vector<std::vector<uint16_t>> colors;
  std::vector<DeviceViewSource> sources;
  for (int v = 0; v < 3; ++v) colors.push_back(ColorsOf(v));
  for (int v = 0; v < 3; ++v) {
    DeviceViewSource source;
    source.origin = {static_cast<float>(v), 0, 0};
    source.width = kWidth;
    source.height = kHeight;
    source.color = colors[static_cast<size_t>(v)].data();
    if (v == 1) {
      source.drawn = drawn.data();
      source.num_drawn = static_cast<int32_t>(drawn.size());
    }
    sources.push_back(source);
  }
  const DeviceViews views({directions}, sources);
  constexpr int64_t kRays = 5000;
  constexpr uint64_t kSeed = 7, kStep = 11;
  DeviceBuffer<Ray> rays(kRays, "rays");
  DeviceBuffer<Vec3f> targets(kRays, "colours");
  views.Draw(kSeed, kStep, kRays, rays.data(), targets.data());
  const Buffer<Ray> ray = rays.ToHost();
  const Buffer<Vec3f> target = targets.ToHost();
  const double turn = RandomDouble(kSeed, kStep, 0);
  for (int64_t i = 0; i < kRays; ++i) {
    const int view = static_cast<int>((static_cast<double>(i) + turn) / kRays * 3) % 3;
    const uint64_t counter = 1 + 2 * static_cast<uint64_t>(i);
    const uint64_t pixel =
        view == 1
            ? static_cast<uint64_t>(drawn[RandomIndex(kSeed, kStep, counter, drawn.size())])
            : RandomIndex(kSeed, kStep, counter, kWidth) +
                  kWidth * RandomIndex(kSeed, kStep, counter + 1, kHeight);
    ASSERT_EQ(ray[i].origin.x, static_cast<float>(view)) << i;
    ASSERT_EQ(ray[i].direction.x, static_cast<float>(pixel)) << i;
    ASSERT_EQ(target[i].x, static_cast<float>(pixel) / 65535.0f) << i;
    ASSERT_EQ(target[i].y, static_cast<float>(view) / 65535.0f) << i;
  }
}

}  // namespace
}  // namespace regrade
