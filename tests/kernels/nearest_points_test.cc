// The nearest points of a k-d tree against all distances.
#include "kernels/scene/nearest_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "kernels/base/random.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

std::vector<Vec3f> SomePoints(int64_t count, double grid) {
  std::vector<Vec3f> points;
  for (uint64_t i = 0; i < static_cast<uint64_t>(count); ++i) {
    Vec3f& p = points.emplace_back();
    for (uint64_t a = 0; a < 3; ++a) {
      const double x = RandomDouble(5, a, i);
      p[static_cast<int>(a)] = static_cast<float>(grid > 0 ? std::floor(x * grid) : x);
    }
  }
  return points;
}

std::vector<int32_t> Plain(const std::vector<Vec3f>& points, int count) {
  std::vector<int32_t> nearest;
  for (size_t i = 0; i < points.size(); ++i) {
    std::vector<std::pair<float, int32_t>> all;
    for (size_t j = 0; j < points.size(); ++j) {
      const Vec3f d = points[j] - points[i];
      if (j != i) all.emplace_back(Dot(d, d), static_cast<int32_t>(j));
    }
    std::sort(all.begin(), all.end());
    for (size_t k = 0; k < static_cast<size_t>(count); ++k)
      nearest.push_back(k < all.size() ? all[k].second : -1);
  }
  return nearest;
}

TEST(NearestPoints, AreThoseOfAllDistances) {
  EXPECT_EQ(NearestPoints(SomePoints(700, 0), 5), Plain(SomePoints(700, 0), 5));
}

// On a grid of 4 x 4 x 4 most distances occur many times, 0 among them.
TEST(NearestPoints, OfEquallyNearOnesTheLowerIndex) {
  EXPECT_EQ(NearestPoints(SomePoints(400, 4), 7), Plain(SomePoints(400, 4), 7));
}

TEST(NearestPoints, FewPointsHaveFewNeighbours) {
  EXPECT_EQ(NearestPoints({{0, 0, 0}, {1, 0, 0}}, 3),
            (std::vector<int32_t>{1, -1, -1, 0, -1, -1}));
  EXPECT_TRUE(NearestPoints({}, 3).empty());
}

TEST(NearestPoints, TheSameForAnyNumberOfThreads) {
  const std::vector<Vec3f> points = SomePoints(2000, 0);
  const auto one = [&] {
    const testing::Threads single(1);
    return NearestPoints(points, 6);
  }();
  const testing::Threads many(5);
  EXPECT_EQ(one, NearestPoints(points, 6));
}

}  // namespace
}  // namespace regrade
