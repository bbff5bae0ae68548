// The options of regrade_gpu in their precedence, and a fit that they lower to memory.
#include "pipeline/gpu/gpu_options.h"

#include <gtest/gtest.h>

#include "kernels/base/error.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/run/plan.h"
#include "tests/support/ball_views.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/threads.h"

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

// `regrade run` has a --field of its own, the kind of field, which presets set.
TEST(GpuOptions, APresetSetsTheEffortAndNoFile) {
  for (const std::string& command : {std::string("fit"), std::string("splats")}) {
    GpuSettings settings;
    OptionSet options;
    ASSERT_TRUE(settings.Bind(command, &options));
    ReadFlags({"--capture", "a.npz", "--preset", "best"}, &options);
    EXPECT_EQ(settings.fit_packed.out + settings.fit_splats.out, "");
    EXPECT_EQ(settings.fit.resolutions.back(),
              command == "fit" ? 512 : FitOptions().resolutions.back());
    EXPECT_EQ(settings.splats.steps, command == "splats" ? 10000 : SplatFitOptions().steps);
  }
}

TEST(GpuOptions, StrayWordsAndUnknownRecipesAreRefused) {
  EXPECT_THROW(Read({"paper"}), Error);
  EXPECT_THROW(Read({"--recipe=fast"}), Error);
}

using FitPackedBall = testing::FitField;

// 96 voxels a side are planned with 0.2 GB and a little, 64 with less than 0.17.
TEST_F(FitPackedBall, TheGridIsLoweredToMemory) {
  const testing::Threads threads(2);
  const testing::TemporaryFolder folder;
  PackedCapture capture;
  capture.scene.box = box_;
  for (size_t i = 0; i < cameras_.size(); ++i)
    capture.views.push_back(
        {.file = "photo", .held_out = i == 0, .camera = cameras_[i], .photo = photos_[i]});
  FitPackedOptions settings;
  settings.capture = folder / "ball.npz";
  WritePackedCapture(settings.capture, capture);
  settings.out = folder / "field.npz";
  settings.device = "cpu";
  settings.max_memory_gb = 0.18;
  options_.resolutions = {16, 96};
  options_.steps = {1, 1};
  options_.rays_per_step = 64;
  options_.sh_degree = 0;
  options_.prune_weight = 0;
  OptionSet bound;
  FitPacked(settings, options_, &bound);
  const int side = ReadFieldFile(settings.out).field.geometry->frame.resolution.x;
  EXPECT_GE(side, kLeastResolution);
  EXPECT_LT(side, 96);
}

}  // namespace
}  // namespace regrade
