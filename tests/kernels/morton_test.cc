// Keys of places in Morton's order.
#include "kernels/base/morton.h"

#include <gtest/gtest.h>

namespace regrade {
namespace {

TEST(Morton, KeysInterleaveTheBitsOfPlaces) {
  EXPECT_EQ(KeyOf({0, 0, 0}), 0u);
  for (int bit = 0; bit < 21; ++bit) {
    EXPECT_EQ(KeyOf({1 << bit, 0, 0}), uint64_t{4} << 3 * bit);
    EXPECT_EQ(KeyOf({0, 1 << bit, 0}), uint64_t{2} << 3 * bit);
    EXPECT_EQ(KeyOf({0, 0, 1 << bit}), uint64_t{1} << 3 * bit);
  }
  EXPECT_EQ(KeyOf({kMostPlace, kMostPlace, kMostPlace}), (uint64_t{1} << 63) - 1);
}

// All places of a cube precede those of the next one.
TEST(Morton, PlacesOfACubeAreTogether) {
  const uint64_t low = KeyOf({8, 16, 24});
  for (int x = 0; x < 4; ++x)
    for (int y = 0; y < 4; ++y)
      for (int z = 0; z < 4; ++z) {
        EXPECT_GE(KeyOf({8 + x, 16 + y, 24 + z}), low);
        EXPECT_LT(KeyOf({8 + x, 16 + y, 24 + z}), low + 64);
      }
}

}  // namespace
}  // namespace regrade
