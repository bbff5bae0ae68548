#include "pipeline/fields/splat_checkpoint.h"

namespace regrade {
namespace {

constexpr uint32_t kSplatCheckpoint = 0x5350'0002;  // no version of a voxel fit's

// Calls visit for every value of the state but its arrays, the curve and the note.
template <typename State, typename Visit>
void VisitValues(State* state, const Visit& visit) {
  visit(&state->splats.basis);
  for (int a = 0; a < 3; ++a) visit(&state->splats.background[a]);
  visit(&state->step), visit(&state->frozen), visit(&state->spare_unseen);
  auto& tally = state->tally;
  visit(&tally.window_error), visit(&tally.tail_error);
  visit(&tally.window_values), visit(&tally.tail_values);
  visit(&tally.pixels), visit(&tally.entries), visit(&tally.rejected);
}

template <typename State, typename Visit>
void VisitArrays(State* state, const Visit& visit) {
  for (auto* splats : {&state->splats, &state->first_moment, &state->second_moment}) {
    visit(&splats->mean), visit(&splats->log_scale), visit(&splats->quaternion);
    visit(&splats->opacity_logit), visit(&splats->sh);
  }
}

bool Consistent(const Splats& splats, size_t n, int basis) {
  return splats.mean.size() == 3 * n && splats.log_scale.size() == 3 * n &&
         splats.quaternion.size() == 4 * n && splats.opacity_logit.size() == n &&
         splats.sh.size() == 3 * n * static_cast<size_t>(basis);
}

}  // namespace

BytePacker PackSplatFitState(const SplatFitState& state, const std::string& note) {
  BytePacker packer;
  packer.Value(kSplatCheckpoint);
  packer.Values(note);
  VisitValues(&state, [&](const auto* value) { packer.Value(*value); });
  packer.Value(static_cast<int64_t>(state.tally.curve.size()));
  for (const SplatCurvePoint& point : state.tally.curve) {
    packer.Value(point.step);
    packer.Value(point.seconds);
    packer.Value(point.psnr_train_db);
    packer.Value(point.splats);
  }
  VisitArrays(&state, [&](const auto* array) { packer.Reference(*array); });
  return packer;
}

std::optional<SplatFitState> UnpackSplatFitState(std::string_view bytes, std::string* note) {
  ByteUnpacker unpacker(bytes);
  SplatFitState state;
  uint32_t version = 0;
  unpacker.Value(&version);
  if (version != kSplatCheckpoint) return std::nullopt;
  unpacker.Values(note);
  VisitValues(&state, [&](auto* value) { unpacker.Value(value); });
  int64_t points = 0;
  unpacker.Value(&points);
  for (int64_t i = 0; i < points && unpacker.ok(); ++i) {
    SplatCurvePoint& point = state.tally.curve.emplace_back();
    unpacker.Value(&point.step);
    unpacker.Value(&point.seconds);
    unpacker.Value(&point.psnr_train_db);
    unpacker.Value(&point.splats);
  }
  VisitArrays(&state, [&](auto* array) { unpacker.Values(array); });
  const int basis = state.splats.basis;
  if (!unpacker.at_end() || !IsBasis(basis) || state.step < 0 || state.frozen < 0 ||
      state.frozen > state.splats.count())
    return std::nullopt;
  for (Splats* splats : {&state.splats, &state.first_moment, &state.second_moment}) {
    splats->basis = basis;
    if (!Consistent(*splats, state.splats.opacity_logit.size(), basis)) return std::nullopt;
  }
  return state;
}

}  // namespace regrade
