#include "pipeline/fields/network_checkpoint.h"

#include "pipeline/files/byte_packing.h"

namespace regrade {
namespace {

constexpr uint32_t kNetworkCheckpoint = 4;

// Lists the members once for both directions.
template <typename Visitor, typename State>
void Visit(Visitor* visit, State* state) {
  auto& network = state->network;
  visit->Value(&network.basis);
  visit->Text(&network.activation);
  visit->Value(&network.omega);
  visit->Value(&network.sh_scale);
  visit->Value(&network.position_scale);
  visit->Value(&network.has_base);
  for (auto* map : {&network.base, &state->linear_map})
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) visit->Value(&map->matrix(i, j));
      visit->Value(&map->offset[i]);
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

struct Packing {
  BytePacker packer;
  template <typename T>
  void Value(const T* value) {
    packer.Value(*value);
  }
  template <typename T>
  void Values(const T* values) {
    packer.Values(*values);
  }
  void Text(const std::string* text) { packer.Values(*text); }
};

struct Unpacking {
  ByteUnpacker unpacker;
  template <typename T>
  void Value(T* value) {
    unpacker.Value(value);
  }
  template <typename T>
  void Values(T* values) {
    unpacker.Values(values);
  }
  void Text(std::string* text) { unpacker.Values(text); }
};

}  // namespace

std::string PackTrainingState(const TrainingState& state) {
  Packing packing;
  packing.packer.Value(kNetworkCheckpoint);
  Visit(&packing, &state);
  return packing.packer.Joined();
}

std::optional<TrainingState> UnpackTrainingState(std::string_view bytes) {
  Unpacking unpacking{ByteUnpacker(bytes)};
  uint32_t version = 0;
  unpacking.Value(&version);
  if (version != kNetworkCheckpoint) return std::nullopt;
  TrainingState state;
  Visit(&unpacking, &state);
  if (!unpacking.unpacker.at_end()) return std::nullopt;
  return state;
}

}  // namespace regrade
