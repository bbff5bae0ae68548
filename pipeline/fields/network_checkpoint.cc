#include "pipeline/fields/network_checkpoint.h"

#include "pipeline/files/byte_packing.h"

namespace regrade {
namespace {

constexpr uint32_t kVersion = 2;

// Lists the members once for both directions.
template <typename Visitor, typename State>
void Visit(Visitor* visit, State* state) {
  auto& network = state->network;
  visit->Values(&network.activation);
  visit->Value(&network.omega);
  visit->Value(&network.sh_scale);
  visit->Value(&network.position_scale);
  visit->Value(&network.has_base);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) visit->Value(&network.base.matrix(i, j));
    visit->Value(&network.base.offset[i]);
  }
  visit->Values(&network.parameters);
  visit->Values(&network.singular_vectors);
  visit->Values(&state->adam.first_moment);
  visit->Values(&state->adam.second_moment);
  visit->Value(&state->adam.steps);
  visit->Value(&state->adam.rejected);
  visit->Value(&state->step);
  visit->Value(&state->linear_map_mse);
  visit->Value(&state->left_out_pixels);
  visit->Values(&state->history.steps);
  visit->Values(&state->history.bounds);
}

}  // namespace

std::string PackTrainingState(const TrainingState& state) {
  BytePacker packer;
  packer.Value(&kVersion);
  Visit(&packer, &state);
  return packer.Take();
}

std::optional<TrainingState> UnpackTrainingState(std::string_view bytes) {
  ByteUnpacker unpacker(bytes);
  uint32_t version = 0;
  unpacker.Value(&version);
  if (version != kVersion) return std::nullopt;
  TrainingState state;
  Visit(&unpacker, &state);
  if (!unpacker.at_end()) return std::nullopt;
  return state;
}

}  // namespace regrade
