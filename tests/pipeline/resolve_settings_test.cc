#include "pipeline/run/resolve_settings.h"

#include <gtest/gtest.h>

#include "evaluate/protocols.h"
#include "pipeline/run/presets.h"
#include "pipeline/run/run_settings.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

struct Resolved {
  RunSettings settings;
  std::vector<std::string> words;
};

Resolved Resolve(const std::vector<std::string>& flags, const SettingsSources& sources = {}) {
  Resolved resolved;
  OptionSet options;
  resolved.settings.Bind(&options);
  options.Parse(flags);
  resolved.words = ResolveSettings(sources, &options);
  return resolved;
}

// Every flag of the program is unique: binding checks it.
TEST(RunSettings, AllOptionsBind) {
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  EXPECT_NE(options.Help().find("--photo-size"), std::string::npos);
  for (const bool on_card : {false, true})
    for (const char* preset : kPresets) {
      RunSettings other;
      ApplyPreset(preset, on_card, &other);
      EXPECT_EQ(other.run.preset, preset);
      // Presets stay within the bounds that users have.
      OptionSet bound;
      other.Bind(&bound);
      EXPECT_NO_THROW(bound.ApplyConfig(bound.Values(), preset)) << preset;
    }
  EXPECT_REGRADE_ERROR(ApplyPreset("fast", false, &settings), ExitCode::kUsage, "draft");
}

TEST(ResolveSettings, EachOptionSaysWhoSetIt) {
  const TemporaryFolder folder;
  const std::string config = folder / "some.json", run = folder / "run.json";
  WriteText(config, R"({"splat-opacity-weight": 0.03, "gaps": [2]})");
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  options.Parse({"--preset", "draft", "--config", config, "--seed", "0"});
  ResolveSettings({}, &options);
  JsonValue setters = options.Setters();
  EXPECT_EQ(setters.At("splat-steps").AsString(), "preset draft");
  EXPECT_EQ(setters.At("splat-opacity-weight").AsString(), config);  // its default, too
  EXPECT_EQ(setters.At("gaps").AsString(), config);
  EXPECT_EQ(setters.At("seed").AsString(), "flag");
  EXPECT_EQ(setters.Find("holdout"), nullptr);

  // A command that continues the run knows it, and changes some.
  WriteText(run, DumpJson(JsonValue::Object{{"schema", 2},
                                            {"arguments", JsonValue::Array()},
                                            {"options", options.Values()},
                                            {"set_by", setters}},
                          -1));
  RunSettings later;
  OptionSet again;
  later.Bind(&again);
  again.Parse({"--gaps", "3"});
  ResolveSettings({.run_json = run}, &again);
  setters["gaps"] = "flag";
  for (const auto& [name, by] : setters.AsObject())
    EXPECT_EQ(again.SetBy(name), again.IsOnce(name) ? "" : by.AsString()) << name;
  for (const char* wrong : {"3", R"({"seed": 3})"}) {
    WriteText(run, std::string(R"({"schema": 2, "arguments": [], "options": {}, "set_by": )") +
                       wrong + "}");
    EXPECT_REGRADE_ERROR(Resolve({}, {.run_json = run}), ExitCode::kUsage, "run.json");
  }
}

TEST(ResolveSettings, PresetsGiveTheirValues) {
  for (const char* preset : kPresets) {
    RunSettings expected;
    ApplyPreset(preset, false, &expected);
    OptionSet bound;
    expected.Bind(&bound);
    RunSettings settings;
    OptionSet options;
    settings.Bind(&options);
    options.Parse({"--preset", preset});
    ResolveSettings({}, &options);
    EXPECT_EQ(DumpJson(options.Values()), DumpJson(bound.Values())) << preset;
  }
  EXPECT_LT(Resolve({"--preset", "smoke"}).settings.fit.resolutions.back(),
            FitOptions().resolutions.back());
  EXPECT_REGRADE_ERROR(Resolve({"--preset", "fast"}), ExitCode::kUsage, "draft");
  EXPECT_EQ(Resolve({}, {.preset = "draft"}).settings.scene.photo_size, 480);
  EXPECT_EQ(Resolve({"--preset=standard"}, {.preset = "draft"}).settings.scene.photo_size, 800);
}

// The paper's preset evaluates as the paper does, a later one as ever; flags override both.
TEST(ResolveSettings, ThePapersPresetEvaluatesByItsProtocol) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.json";
  WriteText(run, R"({"arguments": ["/photos"], "options": {"preset": "paper"}})");
  EXPECT_EQ(ProtocolOf(Resolve({"--preset", "paper"}).settings.consistency), "liprf");
  EXPECT_EQ(ProtocolOf(Resolve({}, {.run_json = run}).settings.consistency), "liprf");
  const ConsistencyOptions plain,
      draft = Resolve({"--preset", "draft"}, {.run_json = run}).settings.consistency;
  EXPECT_EQ(draft.mode, plain.mode);
  EXPECT_EQ(draft.warp, plain.warp);
  const ConsistencyOptions own =
      Resolve({"--preset", "paper", "--warp", "later", "--config", R"({"error-per": "pixel"})"})
          .settings.consistency;
  EXPECT_EQ(own.mode, "ruder2016");
  EXPECT_EQ(own.warp, "later");
  EXPECT_EQ(own.error_per, "pixel");
  EXPECT_EQ(ProtocolOf(own), "");
}

TEST(ResolveSettings, LaterSourcesOverrideEarlierOnes) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.json", config = folder / "config.json";
  WriteText(run, R"({"arguments": ["/photos"], "options":
                 {"preset": "draft", "photo-size": 300, "fps": 12, "style-rays": 7}})");
  WriteText(config,
            R"({"arguments": ["/more"], "options": {"fps": 30, "recipe": "standard"}})");
  const SettingsSources sources{.run_json = run};

  Resolved r = Resolve({}, sources);
  EXPECT_EQ(r.words, std::vector<std::string>{"/photos"});
  RunSettings draft;
  ApplyPreset("draft", false, &draft);
  EXPECT_EQ(r.settings.fit.resolutions, draft.fit.resolutions);  // its preset
  EXPECT_EQ(r.settings.scene.photo_size, 300);                   // its option over its preset
  EXPECT_EQ(r.settings.network.rays_per_step, 7);

  r = Resolve({"--config", config}, sources);
  EXPECT_EQ(r.words, std::vector<std::string>{"/photos"});
  EXPECT_EQ(Resolve({"--config", config}).words, std::vector<std::string>{"/more"});
  EXPECT_EQ(r.settings.render.fps, 30);
  EXPECT_EQ(r.settings.scene.photo_size, 300);

  // A preset as a flag overrides all that presets set, and nothing else.
  r = Resolve({"--preset", "standard"}, sources);
  EXPECT_EQ(r.settings.scene.photo_size, 800);
  EXPECT_EQ(r.settings.fit.resolutions, FitOptions().resolutions);
  EXPECT_EQ(r.settings.network.rays_per_step, TrainNetworkOptions().rays_per_step);
  EXPECT_EQ(r.settings.render.fps, 12);

  // Constants stand over presets.
  r = Resolve({"--field", "voxels", "--config", R"({"tv-sh": 0.5})"});
  EXPECT_EQ(r.settings.fit.tv_sh, 0.5f);
  EXPECT_EQ(r.settings.fit.resolutions, FitOptions().resolutions);
  r = Resolve({"--preset", "paper", "--config", R"({"tv-density": 0.05})"});
  EXPECT_EQ(r.settings.fit.tv_density, 0.05f);
  EXPECT_EQ(r.settings.fit.rate_density, 30.0f);

  r = Resolve({"--preset", "best", "--photo-size", "320", "--recipe", "paper"}, sources);
  EXPECT_EQ(r.settings.scene.photo_size, 320);
  EXPECT_EQ(r.settings.network.recipe, "paper");
  EXPECT_EQ(r.settings.network.steps, 300);  // of the recipe, not of the preset

  r = Resolve({"--photo-size=64"}, {.run_json = run, .taken = {"fps"}});
  EXPECT_EQ(r.settings.render.fps, 12);
  EXPECT_EQ(r.settings.scene.photo_size, 64);
  EXPECT_EQ(r.settings.fit.resolutions, FitOptions().resolutions);
}

// Presets fit splats, the paper's voxels; a folder from before there was a choice has voxels.
TEST(ResolveSettings, FlagsOfTheOtherKindOfFieldAreRefused) {
  EXPECT_EQ(Resolve({}).settings.scene.field, "splats");
  EXPECT_EQ(Resolve({"--preset", "paper"}).settings.scene.field, "voxels");
  EXPECT_REGRADE_ERROR(Resolve({"--config", R"({"fit-steps": [10]})"}), ExitCode::kUsage,
                       "--field voxels");
  EXPECT_REGRADE_ERROR(Resolve({"--preset", "paper", "--splat-steps", "10"}), ExitCode::kUsage,
                       "--field splats");
  EXPECT_EQ(
      Resolve({"--field", "voxels", "--config", R"({"fit-steps": [10]})"}).settings.fit.steps,
      std::vector<int>{10});
  // Splats have far surroundings, and no device coordinates.
  CheckTogether(Resolve({"--effects", "background=on"}).settings);
  EXPECT_REGRADE_ERROR(CheckTogether(Resolve({"--effects", "ndc=on"}).settings),
                       ExitCode::kUsage, "--field voxels");
  const TemporaryFolder folder;
  const std::string run = folder / "run.json";
  WriteText(run, R"({"arguments": ["/photos"], "options": {"preset": "draft"}})");
  EXPECT_EQ(Resolve({}, {.run_json = run}).settings.scene.field, "voxels");
}

// A run.json of an earlier version names options that only its fits had; a user's --config may
// not.
TEST(ResolveSettings, OptionsOfEarlierVersionsAreDropped) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.json";
  const std::string earlier =
      R"("fit-field": "adaptive", "fit-fewer-stages": true, "fit-cell-pixels": 1, )"
      R"("exact": false, "keep-field": true, "style-regrain": false, "style-features": "", )"
      R"("fit-max-cells": 5, "fit-max-forward-cells": 12, "fit-outward": 2, )"
      R"("fit-free-space": "auto", "fit-rate-density": "auto", "fit-rate-density-end": "auto", )"
      R"("tv-density": "auto", "tv-sh": "auto", "tv-decay": 0.7, "fit-rate-sh": 0.05, )"
      R"("fit-resolutions": [48, 96, 192, 384], "background-lead": 0.25, )"
      R"("controls": true, "control-field": true, "match": "regions", )"
      R"("match-network": "/f.onnx")";
  WriteText(run, R"({"arguments": ["/photos"], "options": {"preset": "draft", "fps": 12, )" +
                     earlier + "}}");
  for (const RunSettings& settings :
       {Resolve({}, {.run_json = run}).settings, Resolve({"--config", run}).settings}) {
    EXPECT_EQ(settings.render.fps, 12);
    EXPECT_EQ(settings.consistency.controls, "field");
    EXPECT_EQ(settings.fit.rate_density, FitOptions().rate_density);
    EXPECT_EQ(settings.fit.tv_sh, FitOptions().tv_sh);
    EXPECT_EQ(settings.fit.tv_decay, FitOptions().tv_decay);
    EXPECT_EQ(settings.fit.rate_sh, FitOptions().rate_sh);
    EXPECT_LT(settings.fit.resolutions.back(), 384);
  }
  EXPECT_EQ(Resolve({"--config", run}).settings.style.match.Network(), "/f.onnx");
  for (const char* config : {R"({"fit-field": "adaptive"})", R"({"tv-density": "auto"})"})
    EXPECT_REGRADE_ERROR(Resolve({"--field", "voxels", "--config", config}), ExitCode::kUsage,
                         config[2] == 'f' ? "fit-field" : "tv-density");
}

// Constants come from --config alone: over presets and recipes, whichever comes first.
TEST(ResolveSettings, ConstantsAreNoFlags) {
  EXPECT_REGRADE_ERROR(Resolve({"--field", "voxels", "--tv-sh", "0.5"}), ExitCode::kUsage,
                       R"(--config '{"tv-sh":0.5}')");
  EXPECT_REGRADE_ERROR(Resolve({"--config", R"({"tv-sh": 0.5})"}), ExitCode::kUsage,
                       "--field voxels");
  EXPECT_REGRADE_ERROR(Resolve({"--config", R"({"style-ratio": 0.5})"}), ExitCode::kUsage,
                       "style-rate");
  EXPECT_EQ(Resolve({"--config", R"({"style-rays": 99})", "--recipe", "paper"})
                .settings.network.rays_per_step,
            99);
  const TemporaryFolder folder;
  WriteText(folder / "some.json", R"({"style-rays": 98, "splat-steps": 7})");
  const RunSettings settings =
      Resolve({"--config", folder / "some.json", "--preset", "best", "--splat-steps", "8"})
          .settings;
  EXPECT_EQ(settings.network.rays_per_step, 98);
  EXPECT_EQ(settings.splats.steps, 8);
}

TEST(ResolveSettings, RecipeSetsEveryOptionOfTheNetwork) {
  TrainNetworkOptions paper;
  ApplyStyleRecipe("paper", &paper);
  for (const std::vector<std::string>& flags :
       {std::vector<std::string>{"--recipe", "paper", "--style-rays", "1024"},
        std::vector<std::string>{"--recipe=paper", "--style-rays=1024"}}) {
    // A command may bind the network's options alone.
    TrainNetworkOptions network;
    OptionSet options;
    options.Add("Network", &network);
    options.Parse(flags);
    ResolveSettings({}, &options);
    EXPECT_EQ(network.recipe, "paper");
    EXPECT_EQ(network.base, paper.base);
    EXPECT_EQ(network.rate_first, paper.rate_first);
    EXPECT_EQ(network.norm_steps, paper.norm_steps);
    EXPECT_EQ(network.rays_per_step, 1024);
  }
  EXPECT_REGRADE_ERROR(Resolve({"--recipe=fast"}), ExitCode::kUsage, "--recipe");
}

// On a GPU sums are exact only if asked for, and a reproducible run asks.
TEST(ResolveSettings, H68_AReproducibleRunOnTheGpuHasExactSums) {
  const auto both = [](const std::vector<std::string>& flags,
                       const SettingsSources& from = {}) {
    const RunSettings settings = Resolve(flags, from).settings;
    EXPECT_EQ(settings.fit.exact_sums, settings.network.loss.exact_sums);
    return settings.fit.exact_sums;
  };
  EXPECT_TRUE(both({"--reproducible", "--device", "cuda"}));
  EXPECT_TRUE(both({"--reproducible", "--device", "cuda", "--recipe", "paper"}));
  EXPECT_TRUE(both(
      {"--reproducible", "--device", "cuda", "--config", R"({"style-exact-sums": false})"}));
  EXPECT_TRUE(both({"--reproducible", "--device", "cuda", "--field", "voxels", "--config",
                    R"({"fit-exact-sums": false, "style-exact-sums": false})"}));
  EXPECT_FALSE(both({"--reproducible"}));  // on the CPU: device auto
  EXPECT_FALSE(both({"--reproducible", "--device", "cpu"}));
  EXPECT_FALSE(both({"--device", "cuda"}));
  const TemporaryFolder folder;
  const std::string run = folder / "run.json";
  WriteText(run, R"({"arguments": ["/photos"], "options": {"reproducible": true}})");
  EXPECT_TRUE(both({"--device", "cuda"}, {.run_json = run}));
  EXPECT_FALSE(both({}, {.run_json = run}));
}

// Headings are for readers; a stage's inputs hold names and values alone.
TEST(OptionValues, AreFreeOfHeadings) {
  SceneOptions scene;
  FitOptions fit;
  OptionSet reworded;
  reworded.Add("Photos and frames", &scene);
  reworded.Add("Reconstruction", &fit);
  EXPECT_EQ(DumpJson(OptionValues(scene, fit)), DumpJson(reworded.Values()));
  EXPECT_EQ(OptionValues(scene).AsObject().size(), 6u);
  EXPECT_EQ(OptionValues(scene).At("photo-size").AsInt(), 800);
}

}  // namespace
}  // namespace regrade
