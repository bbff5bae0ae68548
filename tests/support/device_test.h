// Fixtures of tests that are skipped without a GPU.
#pragma once

#include <gtest/gtest.h>

#include "kernels/device/device_memory.h"

namespace regrade::testing {

template <typename Base>
class SkippedWithoutGpu : public Base {
 protected:
  void SetUp() override {
    const DeviceStatus status = ReadDeviceStatus();
    if (!status.found) GTEST_SKIP() << "no GPU: " << status.name;
  }
};

using DeviceTest = SkippedWithoutGpu<::testing::Test>;

// Its parameter is the number of spherical harmonics.
class DeviceTestOfBasis : public SkippedWithoutGpu<::testing::TestWithParam<int>> {
 protected:
  int basis() const { return GetParam(); }
};

}  // namespace regrade::testing
