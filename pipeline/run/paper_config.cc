#include "pipeline/run/paper_config.h"

#include <algorithm>
#include <iterator>

#include "evaluate/protocols.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

// What the configurations have in common.
void UseCommon(RunSettings* settings) {
  FitOptions& fit = settings->fit;
  fit.rays_per_step = 5000;
  fit.patch = 1;
  fit.sh_degree = 2;
  fit.step = 0.5f;
  fit.stop_transmittance = 1e-7f;
  fit.view_bound = 1e6f;
  fit.bound_mean = false;
  fit.rate_density = 30;
  fit.rate_density_end = 0.05f;
  fit.rate_sh = 1e-2f;
  fit.rate_sh_end = 5e-6f;
  fit.rate_steps = 250000;
  fit.tv_fraction = 0.01f;
  fit.initial_density = 0.1f;
  fit.initial_views = 0;
  fit.prune_last = false;
  fit.max_voxels = 44;
  fit.background_layers = 64;
  fit.background_resolution = 1024;
  fit.background_grows = false;
  fit.background_lead = 0;
  fit.initial_background_density = 0.1f;
  fit.rate_background_density = 3;
  fit.rate_background_density_end = 3e-3f;
  fit.rate_background_color = 0.1f;
  fit.rate_background_color_end = 5e-6f;
  fit.tv_background_fraction = 0.01f;
  fit.tv_background_decays = false;
  settings->scene.box.near_clip = 0;
}

// No trial of ours decides: degree 2, exposures and poses stay as they are.
std::string Effects(const std::string& of_scene) {
  return of_scene + ",exposure=off,view-dependence=on,pose-refinement=off";
}

// Densities rise to their full rate over 15000 steps; an exact fraction of 102400 and 128000.
constexpr float DelayOf(int steps) { return 15000.0f / static_cast<float>(steps); }

void UseSyn(RunSettings* settings) {
  FitOptions& fit = settings->fit;
  fit.resolutions = {256, 512};
  fit.steps = {38400, 89600};
  fit.density_delay = DelayOf(128000);
  fit.prune_by = "weight-of-next";
  fit.prune_weight = 0.256f;
  fit.tv_density = 1e-5f;
  fit.tv_sh = 1e-3f;
  fit.tv_decay = 0;  // ends with the first upsampling
  fit.ball = true;
  settings->scene.photo_size = 800;
  // Its cameras are 4.031 from the middle, and its box has a half side of 1.5.
  settings->scene.box.camera_range = 2.687f;
  settings->scene.box.background = 1;
  settings->run.effects = Effects("ndc=off,alpha=on,background=off");
}

void UseLlff(RunSettings* settings) {
  FitOptions& fit = settings->fit;
  fit.resolutions = {256, 512, 1408};
  fit.resolutions_y = {256, 512, 1156};
  fit.resolutions_z = {128, 128, 128};
  fit.steps = {38400, 38400, 51200};
  fit.density_delay = DelayOf(128000);
  fit.prune_by = "density";
  fit.prune_weight = 5;
  fit.tv_density = 5e-4f;
  fit.tv_sh = 5e-3f;
  fit.tv_decay = 1;
  fit.sparsity_loss = 1e-12f;
  settings->scene.photo_size = 1008;  // a quarter of its photos
  settings->scene.box.margin = 250.0f / 1008;
  settings->scene.box.background = 0.5f;
  settings->run.effects = Effects("ndc=on,alpha=off,background=off");
}

// Both of captures that cameras surround.
void UseSurrounded(RunSettings* settings) {
  FitOptions& fit = settings->fit;
  fit.prune_by = "weight-of-next";
  fit.prune_weight = 1.28f;
  fit.sparsity_loss = 1e-11f;
  fit.beta_loss = 1e-5f;
  settings->scene.photo_size = 1280;
  settings->run.effects = Effects("ndc=off,alpha=off,background=on");
}

void UseTnt(RunSettings* settings) {
  UseSurrounded(settings);
  FitOptions& fit = settings->fit;
  fit.resolutions = {128, 256, 512, 640};
  fit.steps = {25600, 25600, 25600, 25600};
  fit.density_delay = DelayOf(102400);
  fit.tv_density = 5e-5f;
  fit.tv_sh = 5e-3f;
  fit.tv_decay = 1;
  fit.tv_background_density = fit.tv_background_color = 1e-3f;
  settings->scene.box.camera_range = 0.95f;
  settings->scene.box.background = 1;
}

void UseCustom(RunSettings* settings) {
  UseSurrounded(settings);
  FitOptions& fit = settings->fit;
  fit.resolutions = {128, 256, 512};
  fit.steps = {25600, 25600, 51200};
  fit.background_lead = 1000.0f / 25600;  // the box is empty for 1000 steps
  fit.tv_density = fit.tv_sh = 5e-3f;
  fit.tv_decay = 0.5f;
  fit.tv_background_density = fit.tv_background_color = 5e-3f;
  settings->scene.box.camera_range = 0.9f;
  settings->scene.box.near_clip = 0.35f;
  settings->scene.box.background = 0.5f;
}

struct Config {
  const char* name;
  void (*use)(RunSettings*);
};
constexpr Config kConfigs[] = {
    {"syn", UseSyn}, {"llff", UseLlff}, {"tnt", UseTnt}, {"custom", UseCustom}};

std::string Text(const JsonValue& value) {
  return value.IsString() ? value.AsString() : DumpJson(value, -1);
}

}  // namespace

void UsePaperConfig(const std::string& name, RunSettings* settings) {
  const auto found = std::ranges::find(kConfigs, name, &Config::name);
  if (found == std::end(kConfigs))
    throw UsageError("'" + name + "' is not allowed", kPaperConfig,
                     "give one of auto, syn, llff, tnt, custom");
  settings->scene.box = BoxOptions();
  settings->fit = FitOptions();
  UseCommon(settings);
  found->use(settings);
}

JsonValue DecidedValues(const RunSettings& settings) {
  JsonValue values = JsonValue::Object{{"effects", settings.run.effects}};
  const JsonValue all = OptionValues(settings.scene, settings.fit);
  for (const auto& [option, value] : all.AsObject())
    if (option != "fit-shards" && option != "fit-exact-sums")  // how sums are made, not of what
      values[option] = value;
  return values;
}

JsonValue PaperValues(const std::string& name) {
  RunSettings settings;
  UsePaperConfig(name, &settings);
  return DecidedValues(settings);
}

JsonValue RecipeValues(const RunSettings& settings) {
  JsonValue values = JsonValue::Object();
  const JsonValue all = OptionValues(settings.network);
  for (const auto& [option, value] : all.AsObject())
    if (option != "style-exact-sums" && option != "style-every-voxel" &&
        option != "style-batch")  // the same result
      values[option] = value;
  return values;
}

JsonValue ProtocolValues(const RunSettings& settings) {
  JsonValue values = JsonValue::Object();
  const JsonValue evaluated = OptionValues(settings.consistency);
  for (const char* option : {"mode", "gaps", "warp"}) values[option] = evaluated.At(option);
  return values;
}

PaperChoice ChoosePaperConfig(const std::string& asked, const PaperTraits& traits) {
  if (asked == "syn" && !traits.transparent)
    throw UsageError("syn needs photos with transparent parts, and these have none",
                     "paper-config syn", "leave the choice to auto, or use custom");
  if (asked == "llff" && !traits.forward_facing)
    throw UsageError("llff needs cameras that all look one way, and these do not",
                     "paper-config llff", "leave the choice to auto, or use custom");
  if (asked != "auto") return {asked, Concat("by ", kPaperConfig)};
  if (traits.transparent) return {"syn", "the photos have transparent parts"};
  if (traits.forward_facing) return {"llff", "the cameras all look one way"};
  return {"custom", "the photos are opaque, and the cameras look in several directions"};
}

void CheckPaper(const std::string& preset, const std::string& config) {
  if (preset != "paper" && config != "auto")
    throw UsageError("is a choice within --preset paper", kPaperConfig,
                     "add --preset paper, or leave it out");
}

void ApplyPaperChoice(const PaperChoice& choice, OptionSet* options) {
  const JsonValue now = options->Values(), chosen = PaperValues(choice.name);
  JsonValue set = JsonValue::Object();
  for (const auto& [name, value] : chosen.AsObject()) {
    const std::string& by = options->SetBy(name);
    const bool is_preset =
        by.empty() || by == kPaperConfig || by.starts_with(OptionSet::kPresetOf);
    if (now.Find(name) != nullptr && is_preset) set[name] = value;
  }
  options->ApplyConfig(set, kPaperConfig);
}

std::vector<std::string> NotToTheLetter(const std::string& name, const JsonValue& values) {
  std::vector<std::string> differences;
  RunSettings letter;
  UsePaperConfig(name, &letter);
  ApplyStyleRecipe("paper", &letter.network);
  UseProtocol("liprf", &letter.consistency);
  for (const JsonValue& part :
       {DecidedValues(letter), RecipeValues(letter), ProtocolValues(letter)})
    for (const auto& [option, published] : part.AsObject()) {
      const JsonValue* const value = values.Find(option);
      if (value != nullptr && !(*value == published))
        differences.push_back(option + " is " + Text(*value) + ", published " +
                              Text(published));
    }
  return differences;
}

std::optional<std::vector<std::string>> SayIfPaper(const RunSettings& settings,
                                                   const JsonValue& values, Console* console) {
  if (settings.run.preset != "paper") return std::nullopt;
  std::vector<std::string> differences = NotToTheLetter(kPaperBase, values);
  for (const std::string& difference : differences)
    console->Info("not to the letter: " + difference);
  return differences;
}

}  // namespace regrade
