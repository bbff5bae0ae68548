// Selection of the pairs of photos to match for known poses.
#include "reconstruct/colmap/track_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

// A camera at `angle` on a circle that looks at its centre.
Camera OnCircle(double angle) {
  const double s = std::sin(angle), k = std::cos(angle);
  Camera camera;
  camera.width = 640, camera.height = 480;
  camera.camera_from_world = {{{{k, 0, -s}, {0, 1, 0}, {s, 0, k}}}, {0, 0, 6}};
  return camera;
}

std::vector<Camera> Circle(size_t count) {
  std::vector<Camera> cameras;
  for (size_t i = 0; i < count; ++i)
    cameras.push_back(OnCircle(2 * M_PI * static_cast<double>(i) / static_cast<double>(count)));
  return cameras;
}

TEST(TrackPairs, NeighboursAndSomeFartherAway) {
  const size_t n = 60;
  const auto pairs = PairsToMatch(Circle(n));
  EXPECT_LE(pairs.size(), kPartners * n);
  EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
  EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end()), pairs.end());
  std::vector<size_t> partners(n);
  size_t widest = 0;
  for (const auto& [i, j] : pairs) {
    ASSERT_LT(i, j);
    const size_t steps = std::min(j - i, n - (j - i));
    widest = std::max(widest, steps);
    EXPECT_LE(360 * steps, 75 * n) << "they see different sides";
    ++partners[i], ++partners[j];
  }
  EXPECT_GE(*std::min_element(partners.begin(), partners.end()), kPartners);
  EXPECT_GE(widest, 6u) << "36 degrees: enough for depth";
  for (size_t i = 0; i < n; ++i)  // all neighbours on the circle
    EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(),
                                   std::pair<size_t, size_t>(std::minmax(i, (i + 1) % n))));
}

TEST(TrackPairs, FewPhotosAndOnePlace) {
  EXPECT_TRUE(PairsToMatch({}).empty());
  EXPECT_TRUE(PairsToMatch(Circle(1)).empty());
  const std::vector<Camera> same(3, OnCircle(1));
  EXPECT_EQ(PairsToMatch(same).size(), 3u);
}

}  // namespace
}  // namespace regrade
