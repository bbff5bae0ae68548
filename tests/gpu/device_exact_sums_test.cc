// Gradients summed as integers: bit-identical in any order, and equal to float sums up to
// rounding. Every test is skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/field/cuda/device_rays.h"
#include "tests/support/device_test.h"
#include "tests/support/parity_row.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::RandomField;
using testing::RandomRays;

class DeviceExactSums : public testing::DeviceTestOfBasis {
 protected:
  // A step's gradient of the rays in the given order, including total variation, and the field
  // after the step.
  struct Step {
    Buffer<float> gradient, records;
  };
  Step Make(bool exact, bool backwards) const {
    const FastGrid host = MakeFastGrid(RandomField({16, 14, 15}, basis(), 0.5, 77));
    DeviceGrid grid = UploadGrid(host, true, {}, exact);
    std::vector<Ray> rays = RandomRays(600, 7);
    if (backwards) std::reverse(rays.begin(), rays.end());
    DeviceBuffer<Ray> device_rays(600, "rays");
    DeviceBuffer<Vec3f> targets(600, "targets");
    const std::vector<Vec3f> grey(600, Vec3f{0.4f, 0.5f, 0.2f});
    device_rays.CopyIn(rays.data(), 600);
    targets.CopyIn(grey.data(), 600);
    DeviceTouched touched(grid);
    DeviceRayFitter fitter(grid.frame, {0.5f, 1e-4f}, 64 << 20);
    // All at once or in two parts: other warps run concurrently.
    const int64_t first = backwards ? 250 : 600;
    fitter.Accumulate(grid, device_rays.data(), targets.data(), first, 1.0f / 1800, &touched);
    if (first < 600)
      fitter.Accumulate(grid, device_rays.data() + first, targets.data() + first, 600 - first,
                        1.0f / 1800, &touched);
    AddTotalVariation(grid, backwards ? 40 : 0, grid.num_voxels(), 1e-3f, 1e-4f, &touched);
    Step step;
    step.gradient = DownloadGradient(grid);
    StepOnDevice(&grid, &touched, {.rate_sh = 0.05f, .rate_density = 0.5f, .view_bound = 0.2f},
                 fitter.sums());
    step.records = DownloadGrid(grid).records;
    for (const float rest : DownloadGradient(grid)) EXPECT_EQ(rest, 0.0f);
    return step;
  }
};

TEST_P(DeviceExactSums, TheSameBitsInAnyOrder) {
  const Step one = Make(true, false), other = Make(true, true);
  ASSERT_EQ(one.gradient.size(), other.gradient.size());
  for (int64_t i = 0; i < one.gradient.size(); ++i)
    ASSERT_EQ(one.gradient[i], other.gradient[i]) << i;
  for (int64_t i = 0; i < one.records.size(); ++i)
    ASSERT_EQ(one.records[i], other.records[i]) << i;
}

TEST_P(DeviceExactSums, EqualFloatSumsUpToRounding) {
  const Step exact = Make(true, false), floats = Make(false, false);
  double off = 0, largest = 0;
  for (int64_t i = 0; i < exact.gradient.size(); ++i) {
    off = std::max(off, std::abs(double{exact.gradient[i]} - floats.gradient[i]));
    largest = std::max(largest, std::abs(double{floats.gradient[i]}));
  }
  testing::ParityRow("exact sums", "basis " + std::to_string(basis()),
                     "float sums, of the largest", off / largest, 1e-5);
}

// H104 for integers: a voxel with a non-finite gradient does not change.
TEST_P(DeviceExactSums, NonFiniteGradientsAreNotStepped) {
  const FastGrid before = MakeFastGrid(RandomField({4, 4, 4}, basis(), 1.0, 51));
  DeviceGrid grid = UploadGrid(before, true, {}, true);
  DeviceTouched touched(grid);
  AddTotalVariation(grid, 0, grid.num_voxels(), std::numeric_limits<float>::infinity(), 0,
                    &touched);
  DeviceBuffer<DeviceFitSums> sums(1, "sums");
  sums.Zero();
  StepOnDevice(&grid, &touched, {.rate_sh = 0.05f, .rate_density = 0.5f}, sums.data());
  DeviceFitSums taken;
  sums.CopyOut(&taken, 1);
  EXPECT_EQ(taken.rejected_voxels, static_cast<unsigned long long>(before.num_voxels()));
  const FastGrid after = DownloadGrid(grid);
  for (int64_t i = 0; i < after.records.size(); ++i)
    ASSERT_EQ(after.records[i], before.records[i]);
}

INSTANTIATE_TEST_SUITE_P(AllBases, DeviceExactSums, ::testing::Values(1, 4, 9),
                         [](const auto& info) { return "basis" + std::to_string(info.param); });

}  // namespace
}  // namespace regrade
