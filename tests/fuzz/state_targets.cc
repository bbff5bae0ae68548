// States of an interrupted fit and training. Their checksums stand outside of these bytes, so a
// mutant gets as far as any.
#include "pipeline/fit_checkpoint.h"
#include "pipeline/network_checkpoint.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/small_field.h"

namespace regrade::testing {
namespace {

std::vector<std::string> FitSeeds() {
  std::vector<std::string> seeds;
  for (const bool spheres : {false, true}) {
    RadianceField field = RandomField({5, 4, 6}, 4, 0.5, 1);
    if (spheres) AddSpheres(6, 5, 0.6, 2, &field);
    FitState state;
    state.grid = MakeFastGrid(field);
    state.second_moment.Resize(state.grid.records.size());
    state.sphere_moment.Resize(state.grid.spheres.texels.size());
    state.stage = 1;
    state.step = 17;
    seeds.push_back(PackFitState(state));
  }
  return seeds;
}

bool ReadFit(std::string_view bytes) {
  const auto state = UnpackFitState(bytes);
  if (!state) return false;
  const auto again = UnpackFitState(PackFitState(*state));
  FuzzRequire(again && again->step == state->step, "a round trip is a state again");
  return true;
}

std::vector<std::string> TrainingSeeds() {
  TrainingState state;
  state.network = LipschitzNetwork().data();
  state.adam.first_moment.assign(state.network.parameters.size(), 0);
  state.adam.second_moment = state.adam.first_moment;
  state.history.steps = {0, 10};
  state.history.bounds = {1.5, 2.5};
  return {PackTrainingState(state)};
}

bool ReadTraining(std::string_view bytes) {
  const auto state = UnpackTrainingState(bytes);
  if (!state) return false;
  try {
    const LipschitzNetwork network(state->network);
    FuzzRequire(network.Bound() >= 0, "a network has a bound");
  } catch (const Error&) {
  }
  return true;
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  return MutateBytes(std::move(bytes), random);
}

}  // namespace

std::vector<FuzzTarget> StateTargets() {
  return {{"fit_state", FitSeeds, ReadFit, Mutate, 40000},
          {"training_state", TrainingSeeds, ReadTraining, Mutate, 3000}};
}

}  // namespace regrade::testing
