// paper-config: the resolved settings of each configuration against a table of svox2's, and
// what is refused.
#include "pipeline/run/paper_config.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pipeline/run/presets.h"
#include "pipeline/run/resolve_settings.h"
#include "reconstruct/fit/fit_field.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

struct Bound {
  RunSettings settings;
  OptionSet options;
};

void Resolve(const std::vector<std::string>& flags, Bound* bound) {
  bound->settings.Bind(&bound->options);
  bound->options.Parse(flags);
  ResolveSettings({}, &bound->options);
}

RunSettings Of(std::vector<std::string> flags) {
  Bound bound;
  Resolve(flags, &bound);
  CheckTogether(bound.settings);
  return bound.settings;
}

// svox2's opt/configs and the defaults of its opt.py, as they are after its rules; rates at the
// end of the fit are those of its course over 250000 steps.
struct Published {
  const char* name;
  std::vector<int> x, y, z, steps;
  double density_rate, sh_rate;             // at the end
  double sphere_density_rate, sphere_rate;  // at the end; 0: no background
  int delay_steps, empty_steps;
  const char* threshold;
  double limit;
  std::vector<double> tv_density, tv_sh;  // in each stage
  double sparsity, beta, tv_background, brightness, near_clip, cam_scale;
};

const std::vector<Published> kPublished = {
    {"syn", {256, 512},       {},    {},        {38400, 89600}, 1.13, 2.04e-4, 0, 0, 15000,
     0,     "weight-of-next", 0.256, {1e-5, 0}, {1e-3, 0},      0,    0,       0, 1, 0,
     2.687},
    {"llff",
     {256, 512, 1408},
     {256, 512, 1156},
     {128, 128, 128},
     {38400, 38400, 51200},
     1.13,
     2.04e-4,
     0,
     0,
     15000,
     0,
     "density",
     5,
     {5e-4, 5e-4, 5e-4},
     {5e-3, 5e-3, 5e-3},
     1e-12,
     0,
     0,
     0.5,
     0,
     0},
    {"tnt",
     {128, 256, 512, 640},
     {},
     {},
     {25600, 25600, 25600, 25600},
     2.18,
     4.45e-4,
     0.177,
     1.73e-3,
     15000,
     0,
     "weight-of-next",
     1.28,
     {5e-5, 5e-5, 5e-5, 5e-5},
     {5e-3, 5e-3, 5e-3, 5e-3},
     1e-11,
     1e-5,
     1e-3,
     1,
     0,
     0.95},
    {"custom",
     {128, 256, 512},
     {},
     {},
     {25600, 25600, 51200},
     2.18,
     4.45e-4,
     0.177,
     1.73e-3,
     0,
     1000,
     "weight-of-next",
     1.28,
     {5e-3, 2.5e-3, 1.25e-3},
     {5e-3, 2.5e-3, 1.25e-3},
     1e-11,
     1e-5,
     5e-3,
     0.5,
     0.35,
     0.9}};

double Steps(const FitOptions& fit) {
  double sum = 0;
  for (const int steps : fit.steps) sum += steps;
  return sum;
}

// Half a unit of the last digit that the table prints.
void ExpectPrinted(double value, double printed, const char* what) {
  EXPECT_NEAR(value, printed, 5e-3 * printed) << what;
}

std::vector<std::string> Paper(const std::string& config) {
  return {"--preset", "paper", "--config", R"({"paper-config": ")" + config + R"("})"};
}

TEST(PaperConfig, ResolvedSettingsAreThePublishedOnes) {
  for (const Published& p : kPublished) {
    SCOPED_TRACE(p.name);
    const RunSettings settings = Of(Paper(p.name));
    const FitOptions& fit = settings.fit;
    EXPECT_EQ(fit.resolutions, p.x);
    EXPECT_EQ(fit.resolutions_y, p.y);
    EXPECT_EQ(fit.resolutions_z, p.z);
    EXPECT_EQ(fit.steps, p.steps);
    EXPECT_EQ(fit.rays_per_step, 5000);
    const double done = Steps(fit) / fit.rate_steps;
    EXPECT_EQ(fit.rate_density, 30.0f);
    EXPECT_EQ(fit.rate_sh, 1e-2f);
    ExpectPrinted(ExponentialRate(fit.rate_density, fit.rate_density_end, done), p.density_rate,
                  "rate of densities at the end");
    ExpectPrinted(ExponentialRate(fit.rate_sh, fit.rate_sh_end, done), p.sh_rate,
                  "rate of colours at the end");
    const bool background = p.sphere_rate > 0;
    EXPECT_EQ(settings.run.effects.find("background=on") != std::string::npos, background);
    if (background) {
      EXPECT_EQ(fit.rate_background_density, 3.0f);
      EXPECT_EQ(fit.rate_background_color, 0.1f);
      ExpectPrinted(
          ExponentialRate(fit.rate_background_density, fit.rate_background_density_end, done),
          p.sphere_density_rate, "rate of the background's densities");
      ExpectPrinted(
          ExponentialRate(fit.rate_background_color, fit.rate_background_color_end, done),
          p.sphere_rate, "rate of the background's colours");
      EXPECT_EQ(fit.background_layers, 64);
      EXPECT_EQ(fit.background_resolution, 1024);
      EXPECT_FALSE(fit.background_grows);
      EXPECT_EQ(fit.tv_background_density, static_cast<float>(p.tv_background));
      EXPECT_EQ(fit.tv_background_color, static_cast<float>(p.tv_background));
      EXPECT_EQ(fit.tv_background_fraction, 0.01f);
      EXPECT_FALSE(fit.tv_background_decays);
    }
    EXPECT_EQ(std::lround(double{fit.density_delay} * Steps(fit)), p.delay_steps);
    EXPECT_EQ(static_cast<int>(fit.background_lead * static_cast<float>(fit.steps[0])),
              p.empty_steps);
    EXPECT_EQ(fit.prune_by, p.threshold);
    EXPECT_EQ(fit.prune_weight, static_cast<float>(p.limit));
    EXPECT_FALSE(fit.prune_last);
    EXPECT_EQ(fit.max_voxels, 44.0f);
    for (size_t s = 0; s < p.tv_density.size(); ++s) {
      const float decay = std::pow(fit.tv_decay, static_cast<float>(s));
      EXPECT_FLOAT_EQ(fit.tv_density * decay, static_cast<float>(p.tv_density[s])) << s;
      EXPECT_FLOAT_EQ(fit.tv_sh * decay, static_cast<float>(p.tv_sh[s])) << s;
    }
    EXPECT_EQ(fit.ball || background, std::string(p.name) != "llff");
    EXPECT_EQ(fit.tv_fraction, 0.01f);
    EXPECT_EQ(fit.sparsity_loss, static_cast<float>(p.sparsity));
    EXPECT_EQ(fit.beta_loss, static_cast<float>(p.beta));
    EXPECT_EQ(fit.initial_density, 0.1f);
    EXPECT_EQ(fit.initial_background_density, 0.1f);
    EXPECT_EQ(fit.initial_views, 0);
    EXPECT_EQ(fit.step, 0.5f);
    EXPECT_EQ(fit.stop_transmittance, 1e-7f);
    EXPECT_EQ(fit.sh_degree, 2);
    EXPECT_FALSE(fit.bound_mean);
    EXPECT_GE(fit.view_bound, 1e6f);
    const BoxOptions& box = settings.scene.box;
    EXPECT_EQ(box.background, static_cast<float>(p.brightness));
    EXPECT_EQ(box.near_clip, static_cast<float>(p.near_clip));
    EXPECT_EQ(box.camera_range, static_cast<float>(p.cam_scale));
    EXPECT_EQ(std::lround(box.margin * 1008), std::string(p.name) == "llff" ? 250 : 0);
    for (const char* trial : {"exposure=off", "view-dependence=on", "pose-refinement=off"})
      EXPECT_NE(settings.run.effects.find(trial), std::string::npos) << trial;
    EXPECT_TRUE(NotToTheLetter(p.name, DecidedValues(settings)).empty());
  }
}

TEST(PaperConfig, AutoChoosesByTheCaptureAndSaysWhy) {
  const auto chosen = [](bool transparent, bool forward) {
    const PaperChoice choice = ChoosePaperConfig("auto", {transparent, forward});
    EXPECT_FALSE(choice.reason.empty());
    return choice.name;
  };
  EXPECT_EQ(chosen(true, false), "syn");
  EXPECT_EQ(chosen(true, true), "syn");
  EXPECT_EQ(chosen(false, true), "llff");
  EXPECT_EQ(chosen(false, false), "custom");
  EXPECT_EQ(ChoosePaperConfig("tnt", {}).name, "tnt");
}

// A constant stays, also with the value that the base has, and is recorded.
TEST(PaperConfig, TheChoiceKeepsWhatWasSetByHand) {
  for (const char* steps : {"[7, 8, 9]", "[25600, 25600, 51200]"}) {
    Bound bound;
    Resolve({"--preset", "paper", "--config", Format(R"({"fit-steps": %s})", steps)}, &bound);
    ApplyPaperChoice({"llff", "a test"}, &bound.options);
    EXPECT_EQ(bound.settings.fit.resolutions_z, std::vector<int>({128, 128, 128}));
    EXPECT_EQ(bound.settings.scene.photo_size, 1008);
    const auto differences = NotToTheLetter("llff", DecidedValues(bound.settings));
    ASSERT_EQ(differences.size(), 1u);
    EXPECT_EQ(differences[0].find("fit-steps is ["), 0u) << differences[0];
    EXPECT_NE(differences[0].find("published [38400"), std::string::npos);
  }
}

// Both stages and the protocol are of the letter.
TEST(PaperConfig, TheStyleAndTheProtocolAreOfTheLetter) {
  const auto named = [](const std::vector<std::string>& arguments) {
    std::vector<std::string> options;
    const RunSettings settings = Of(arguments);
    for (const JsonValue& values : {RecipeValues(settings), ProtocolValues(settings)})
      for (const std::string& difference : NotToTheLetter(kPaperBase, values))
        options.push_back(difference.substr(0, difference.find(' ')));
    return options;
  };
  EXPECT_TRUE(named({"--preset", "paper"}).empty());
  EXPECT_EQ(named({"--preset", "paper", "--style-steps", "6", "--mode", "lai2018"}),
            (std::vector<std::string>{"style-steps", "mode"}));
  EXPECT_TRUE(
      named({"--preset", "paper", "--config", R"({"style-exact-sums": true})"}).empty());
  const std::vector<std::string> other = named({"--preset", "paper", "--recipe", "standard"});
  for (const char* option : {"recipe", "style-loss", "style-rays", "style-base", "style-rate"})
    EXPECT_TRUE(std::ranges::count(other, option)) << option;
}

TEST(PaperConfig, ContradictionsAreRefused) {
  EXPECT_REGRADE_ERROR(ChoosePaperConfig("syn", {}), ExitCode::kUsage, "auto");
  EXPECT_REGRADE_ERROR(ChoosePaperConfig("llff", {.transparent = true}), ExitCode::kUsage,
                       "custom");
  EXPECT_REGRADE_ERROR(Of({"--config", R"({"paper-config": "llff"})"}), ExitCode::kUsage,
                       "--preset paper");
  EXPECT_REGRADE_ERROR(Of(Paper("co3d")), ExitCode::kUsage, "llff");
  EXPECT_REGRADE_ERROR(
      Of({"--field", "voxels", "--config", R"({"fit-resolutions-y": [64, 64, 64, 64, 64]})"}),
      ExitCode::kUsage, "5 sides for 3 stages");
}

// Another preset undoes all of it.
TEST(PaperConfig, PresetsResetIt) {
  Bound bound;
  Resolve({"--preset", "standard"}, &bound);
  UsePaperConfig("llff", &bound.settings);
  bound.settings.run.paper_config = "llff";
  ResolveSettings({}, &bound.options);
  EXPECT_EQ(DumpJson(DecidedValues(bound.settings)), DumpJson(DecidedValues(Of({}))));
  EXPECT_EQ(bound.settings.run.paper_config, "auto");
}

}  // namespace
}  // namespace regrade
