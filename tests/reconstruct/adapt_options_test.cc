// What the fit's options become for a capture.
#include "reconstruct/fit/adapt_options.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace regrade {
namespace {

TEST(AdaptOptions, RaysFollowThePixelsOnACardOnly) {
  FitOptions options;
  options.resolutions = {8, 16};
  options.steps = {400, 600};
  const auto rays = [&](bool on_card, int64_t pixels) {
    return AdaptOptions(options, {.on_card = on_card, .pixels = pixels}).rays_per_step;
  };
  EXPECT_EQ(rays(false, 1000000), 4096);
  EXPECT_EQ(rays(true, 100000), 4096);
  EXPECT_EQ(rays(true, 500000), kPasses * 500);
  EXPECT_EQ(rays(true, 100000000), 14336);
  const FitOptions adapted = AdaptOptions(options, {.on_card = true, .pixels = 500000});
  EXPECT_EQ(AdaptOptions(adapted, {.on_card = true, .pixels = 1000000}).rays_per_step,
            adapted.rays_per_step);
  options.rays_per_step = 77;
  EXPECT_EQ(rays(true, 1000000), 77);
}

}  // namespace
}  // namespace regrade
