// The options of regrade_gpu in their precedence.
#include "pipeline/gpu/gpu_options.h"

#include <gtest/gtest.h>

#include "kernels/base/error.h"

namespace regrade {
namespace {

TrainNetworkOptions Read(const std::vector<std::string>& arguments) {
  GpuSettings settings;
  OptionSet options;
  EXPECT_TRUE(settings.Bind("style", &options));
  ReadFlags(arguments, &options);
  return settings.network;
}

TEST(GpuOptions, RecipeSetsDefaultsInBothSpellings) {
  for (const TrainNetworkOptions& network :
       {Read({"--recipe", "paper"}), Read({"--recipe=paper"})}) {
    EXPECT_EQ(network.recipe, "paper");
    EXPECT_EQ(network.base, "none");
    EXPECT_EQ(network.rate_first, 1e-2);
    EXPECT_EQ(network.rays_per_step, 0);
  }
}

TEST(GpuOptions, FlagsOverrideTheRecipeWhereverTheyStand) {
  for (const TrainNetworkOptions& network : {Read({"--style-rays=512", "--recipe=paper"}),
                                             Read({"--recipe=paper", "--style-rays", "512"})}) {
    EXPECT_EQ(network.rays_per_step, 512);
    EXPECT_EQ(network.base, "none");
  }
}

TEST(GpuOptions, StrayWordsAndUnknownRecipesAreRefused) {
  EXPECT_THROW(Read({"paper"}), Error);
  EXPECT_THROW(Read({"--recipe=fast"}), Error);
}

}  // namespace
}  // namespace regrade
