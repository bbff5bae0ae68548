// What the recipes of the style's network set.
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "kernels/base/error.h"
#include "stylize/training/train_network_options.h"

namespace regrade {
namespace {

struct OptionTexts {
  std::string text;
  void operator()(const char* name, const auto& value, const OptionInfo&) {
    std::ostringstream line;
    line << name << ' ' << value << '\n';
    text += line.str();
  }
};

// Every value of the recipe: LipRF Sec. 6 and Algorithm 1, and the readings that
// stylize/README.md names.
TEST(StyleRecipe, PaperSetsEveryValue) {
  TrainNetworkOptions options;
  options.seed = 5;
  // What the recipe must set, or set back.
  options.steps = 1, options.norm_steps = 7, options.loss.every_voxel = true;
  options.hidden_bias = false, options.no_k_est = options.no_regularisation = true;
  options.spectral_normalisation = true, options.start = "siren", options.activation = "relu";
  options.patch = 3, options.view_order = "passes", options.lambda = 1;
  ApplyStyleRecipe("paper", &options);
  OptionTexts texts;
  options.Describe(texts);
  EXPECT_EQ(texts.text,
            "recipe paper\nstyle-steps 300\nstyle-rate 0.01\nstyle-rate-last 0.0001\n"
            "style-lambda 0.0002\nstyle-norm-steps 1\nstyle-settle-norms 0\n"
            "style-hidden-bias 1\nstyle-no-regularisation 0\n"
            "style-spectral-normalisation 0\nstyle-min-weight 0\n"
            "style-max-transmittance 1\nstyle-one-sided 0\nstyle-view-weight 0\n"
            "style-every-voxel 0\nstyle-batch 1048576\nstyle-exact-sums 0\n"
            "style-loss sum-over-voxels\n"
            "style-rays 0\nstyle-patch 8\nstyle-map-background 0\nstyle-base none\n"
            "style-start pytorch\nstyle-view-order random\nstyle-bound 0\n"
            "style-position-scale 1\nstyle-sh-scale 1\nstyle-activation sine\n"
            "style-omega 1\nstyle-no-k-est 0\n");
  EXPECT_EQ(options.seed, 5u);
  EXPECT_THROW(ApplyStyleRecipe("fast", &options), Error);
}

}  // namespace
}  // namespace regrade
