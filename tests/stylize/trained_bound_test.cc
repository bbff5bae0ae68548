// The certificate of trained networks under attack; lipschitz_network_test.cc has random ones.
#include <cstdlib>

#include "tests/support/floating_point_traps.h"
#include "tests/support/steepest_pair.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// Pairs of arbitrary points never exceed the bound of what was learned.
// REGRADE_PAIRS=1000000 takes more of them than 20 000.
TEST(TrainNetwork, H36_NoPairIsSteeperThanTheBoundOfWhatWasLearned) {
  const char* wanted = std::getenv("REGRADE_PAIRS");
  const int pairs = std::max(20000, wanted ? std::atoi(wanted) : 0);
  const StyledBall ball(16, 6, 32, CurvedStyle);
  SceneColorMap map;
  map.k_est = 2;
  for (int c = 0; c < 3; ++c) map.map.matrix(c, c) = 1;
  for (const char* recipe : {"standard", "paper"}) {
    TrainNetworkOptions options;
    ApplyStyleRecipe(recipe, &options);
    options.steps = 60;
    options.rays_per_step = 512;
    const TrainNetworkResult result = TrainNetwork(ball.field, ball.views, map, options, {});
    const double fraction = SteepestPair(result.network, pairs) / result.network.Bound();
    EXPECT_LE(fraction, 1) << recipe;
    EXPECT_GT(fraction, 0.02) << recipe;  // the attack is not idle
  }
}

}  // namespace
}  // namespace regrade
