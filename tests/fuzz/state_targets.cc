// Fuzz targets: network.npz, and checkpoints of fit and training. The checksums of checkpoints
// are not part of these bytes.
#include <cmath>

#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/fields/network_checkpoint.h"
#include "pipeline/fields/network_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/stored_zip.h"
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
    seeds.push_back(PackFitState(state).Joined());
  }
  return seeds;
}

bool ReadFit(std::string_view bytes) {
  const auto state = UnpackFitState(bytes);
  if (!state) return false;
  const auto again = UnpackFitState(PackFitState(*state).Joined());
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

std::vector<std::string> NetworkSeeds() {
  StoredNetwork stored;
  for (size_t i = 0; i < stored.network.data().parameters.size(); ++i)
    stored.network.data().parameters[i] = static_cast<float>(RandomDouble(5, 1, i) - 0.5);
  stored.network.WarmUpNorms();
  stored.k_est = 1.5;
  const std::string path = FuzzFolder() + "/seed_network.npz";
  WriteNetworkFile(path, stored);
  return {StoredCopyOfNpz(path)};
}

bool ReadNetwork(std::string_view bytes) {
  const std::string path = FuzzFile("network.npz", bytes);
  return Accepts([&path] {
    const StoredNetwork stored = ReadNetworkFile(path);
    FuzzRequire(std::isfinite(stored.network.Bound()) && std::isfinite(stored.k_est),
                "its bound is a number");
    double features[64] = {0.5, -0.25, 1}, output[64];
    stored.network.ForwardPlain(features, output);
  });
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  return MutateBytes(std::move(bytes), random);
}

}  // namespace

std::vector<FuzzTarget> StateTargets() {
  return {{"fit_state", FitSeeds, ReadFit, Mutate, 40000},
          {"training_state", TrainingSeeds, ReadTraining, Mutate, 3000},
          {"network_npz", NetworkSeeds, ReadNetwork, MutateNpz, 300}};
}

}  // namespace regrade::testing
