#include "pipeline/run/presets.h"

#include <algorithm>
#include <iterator>
#include <vector>

#include "evaluate/protocols.h"
#include "kernels/base/error.h"
#include "pipeline/run/paper_config.h"

namespace regrade {
namespace {

// Of voxels, planned (plan.h): about 1, 4 and 8 minutes on two cores, and at most half a minute
// on a card of the class of an H200; smoke takes a few seconds, and no film of it is worth a
// look.
struct FitEffort {
  const char* preset;
  bool on_card;
  std::vector<int> resolutions, steps;
};

const FitEffort kFitEfforts[] = {
    {"smoke", false, {24, 48, 96}, {100, 100, 100}},
    {"draft", false, {64, 128, 192}, {400, 1000, 600}},
    {"standard", false, {64, 128, 256}, {800, 2000, 3000}},
    {"best", false, {96, 192, 320}, {2000, 3000, 4000}},
    {"smoke", true, {24, 48, 96}, {100, 100, 100}},
    {"draft", true, {64, 128, 256}, {800, 2000, 3000}},
    {"standard", true, {96, 192, 384}, {2000, 3000, 4000}},
    {"best", true, {128, 256, 512}, {3000, 5000, 8000}},
};

struct SplatEffort {
  const char* preset;
  bool on_card;
  int steps;
  float thousands;  // of splats, at most
};

const SplatEffort kSplatEfforts[] = {
    {"smoke", false, 150, 5},      {"draft", false, 1300, 40},  {"standard", false, 1900, 80},
    {"best", false, 4000, 250},    {"smoke", true, 300, 10},    {"draft", true, 4000, 200},
    {"standard", true, 7500, 500}, {"best", true, 10000, 1000},
};

void UseSplatEffort(const std::string& preset, bool on_card, SplatFitOptions* splats) {
  for (const SplatEffort& effort : kSplatEfforts)
    if (effort.preset == preset && effort.on_card == on_card)
      splats->steps = effort.steps, splats->thousands = effort.thousands;
}

void UseFitEffort(const std::string& preset, bool on_card, FitOptions* fit) {
  const auto found = std::ranges::find_if(kFitEfforts, [&](const FitEffort& effort) {
    return effort.preset == preset && effort.on_card == on_card;
  });
  if (found == std::end(kFitEfforts)) return;
  fit->resolutions = found->resolutions;
  fit->steps = found->steps;
}

}  // namespace

bool IsPreset(const std::string& name) {
  return std::find(std::begin(kPresets), std::end(kPresets), name) != std::end(kPresets);
}

void ApplyPreset(const std::string& preset, bool on_card, RunSettings* settings) {
  if (!IsPreset(preset))
    throw UsageError("'" + preset + "' is not allowed", "--preset",
                     "give one of smoke, draft, standard, paper, best");
  settings->run.preset = preset;
  settings->scene.field = preset == "paper" ? "voxels" : "splats";
  ApplyStyleRecipe(preset == "paper" ? "paper" : "standard", &settings->network);
  UseFitEffort(preset, on_card, &settings->fit);
  UseSplatEffort(preset, on_card, &settings->splats);
  if (preset == "smoke") {
    settings->scene.photo_size = 160;
    settings->network.steps = 60;
    settings->render.film_seconds = 1;
    settings->render.film_size = 160;
  } else if (preset == "draft") {
    settings->scene.photo_size = 480;
    settings->render.film_seconds = 6;
    settings->render.film_size = 480;
  } else if (preset == "best") {
    settings->scene.photo_size = 1280;
    settings->network.steps = 600;
    settings->render.film_seconds = 12;
    settings->render.film_size = 1920;
  } else if (preset == "paper") {
    UsePaperConfig(kPaperBase, settings);
    UseProtocol("liprf", &settings->consistency);
  }
}

}  // namespace regrade
