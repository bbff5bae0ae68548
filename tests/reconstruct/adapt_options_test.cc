// What the fit's options become for a capture.
#include "reconstruct/fit/adapt_options.h"

#include <gtest/gtest.h>

#include <string>

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
  options.rays_per_step = 77;
  EXPECT_EQ(rays(true, 1000000), 77);
}

TEST(AdaptOptions, StagesFinerThanThePhotosAreLeftOut) {
  FitOptions options;
  options.resolutions = {48, 96, 192};
  options.steps = {10, 20, 30};
  const auto stages = [&](int64_t pixels) {
    const FitOptions adapted = AdaptOptions(options, {.pixels = pixels});
    EXPECT_EQ(adapted.steps.size(), adapted.resolutions.size());
    return adapted.resolutions.size();
  };
  EXPECT_EQ(stages(4 * 192 * 192), 3u);
  EXPECT_EQ(stages(4 * 192 * 192 - 1), 2u);
  EXPECT_EQ(stages(1), 1u);
  options.fewer_stages = false;
  EXPECT_EQ(stages(1), 3u);
  options.fewer_stages = true;
  options.MakeUniform();
  EXPECT_EQ(stages(1), 3u);
}

TEST(AdaptOptions, DeviceCoordinatesHaveRatesOfTheirOwnAndWhatWasAskedForStays) {
  FitOptions options;
  const FitOptions elsewhere = AdaptOptions(options, {});
  EXPECT_GT(elsewhere.free_space, 0.0f);
  options.rate_density_end = 7;
  const FitOptions forward = AdaptOptions(options, {.device_coordinates = true});
  EXPECT_LT(forward.rate_density, elsewhere.rate_density);
  EXPECT_EQ(forward.free_space, 0.0f);
  EXPECT_EQ(forward.rate_density_end, 7.0f);
  EXPECT_EQ(forward.tv_sh, elsewhere.tv_sh);
  const FitOptions again = AdaptOptions(forward, {.device_coordinates = true});
  EXPECT_EQ(again.rate_density, forward.rate_density);
  EXPECT_EQ(again.rate_density_end, forward.rate_density_end);
  EXPECT_EQ(again.rays_per_step, forward.rays_per_step);
  options.MakeUniform();
  EXPECT_EQ(AdaptOptions(options, {.device_coordinates = true}).rate_density,
            options.rate_density);
}

// Twice as many cells a side have twice the total variation, for values differ half as much
// across each; and they are fewer.
TEST(AdaptOptions, H192_NarrowCellsInDeviceCoordinates) {
  FitOptions options;
  options.resolutions = {48, 1536};
  options.steps = {1, 1};
  options.max_cells = 20;
  options.tv_sh = 0.5f;
  const FitOptions forward = AdaptOptions(options, {.device_coordinates = true});
  EXPECT_FLOAT_EQ(*forward.tv_density, 2 * *AdaptOptions(options, {}).tv_density);
  EXPECT_EQ(forward.tv_sh, 0.5f);
  EXPECT_EQ(forward.max_cells, options.max_forward_cells);
  const FitOptions again = AdaptOptions(forward, {.device_coordinates = true});
  EXPECT_EQ(again.tv_density, forward.tv_density);
  EXPECT_EQ(NoteOfAdapting(options, forward),
            "the photos face one way, so the field has at most 12 million cells "
            "(fit-max-forward-cells)");
  options.max_cells = 3;
  const FitOptions few = AdaptOptions(options, {.device_coordinates = true});
  EXPECT_EQ(few.max_cells, 3);
  EXPECT_EQ(NoteOfAdapting(options, few), "");
}

TEST(AdaptOptions, AKnownBackgroundHasLessTotalVariation) {
  FitOptions options;
  options.tv_sh = 0.5f;
  const FitOptions known = AdaptOptions(options, {.known_background = true});
  const FitOptions elsewhere = AdaptOptions(options, {});
  EXPECT_LT(known.tv_density, elsewhere.tv_density);
  EXPECT_EQ(known.tv_sh, 0.5f);
  EXPECT_EQ(known.rate_density, elsewhere.rate_density);
  const FitOptions again = AdaptOptions(known, {.known_background = true});
  EXPECT_EQ(again.tv_density, known.tv_density);
  options.MakeUniform();
  EXPECT_EQ(AdaptOptions(options, {.known_background = true}).tv_density, options.tv_density);
}

// A value that was asked for stays, even if it is what other captures have by default.
TEST(AdaptOptions, ValuesAskedForStayWhereTheyAreTheDefaultsOfOthers) {
  FitOptions plain = AdaptOptions({}, {});
  plain.resolutions = {48, 1536};
  plain.steps = {1, 1};
  for (const FitConditions& conditions :
       {FitConditions{.device_coordinates = true}, FitConditions{.known_background = true}}) {
    const FitOptions adapted = AdaptOptions(plain, conditions);
    EXPECT_EQ(adapted.tv_density, plain.tv_density);
    EXPECT_EQ(adapted.tv_sh, plain.tv_sh);
    EXPECT_EQ(adapted.rate_density, plain.rate_density);
    EXPECT_EQ(adapted.rate_density_end, plain.rate_density_end);
    EXPECT_EQ(adapted.free_space, plain.free_space);
  }
}

}  // namespace
}  // namespace regrade
