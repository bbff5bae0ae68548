#include "pipeline/fit_checkpoint.h"

#include <cstring>

namespace regrade {
namespace {

constexpr uint32_t kVersion = 1;

struct FixedPart {
  uint32_t version = kVersion;
  int32_t basis = 0, stage = 0, step = 0;
  GridFrame frame;
  Vec3f background;
  float near_clip = 0;
  int64_t links = 0, records = 0, second_moment = 0;  // elements
};
static_assert(std::is_trivially_copyable_v<FixedPart>);

template <typename T>
void Append(const Buffer<T>& values, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(values.data()), sizeof(T) * values.size());
}

template <typename T>
bool Take(std::string_view* bytes, int64_t size, Buffer<T>* values) {
  if (size < 0 || static_cast<uint64_t>(size) > bytes->size() / sizeof(T)) return false;
  values->Resize(size);
  if (size > 0) std::memcpy(values->data(), bytes->data(), sizeof(T) * size);
  bytes->remove_prefix(sizeof(T) * size);
  return true;
}

}  // namespace

std::string PackFitState(const FitState& state) {
  const FastGrid& grid = state.grid;
  FixedPart fixed;
  std::memset(static_cast<void*>(&fixed), 0,
              sizeof fixed);  // padding too: equal states, equal bytes
  fixed.version = kVersion;
  fixed.basis = grid.basis;
  fixed.stage = state.stage;
  fixed.step = state.step;
  fixed.frame = grid.frame;
  fixed.background = grid.background;
  fixed.near_clip = grid.near_clip;
  fixed.links = grid.links.size();
  fixed.records = grid.records.size();
  fixed.second_moment = state.second_moment.size();
  std::string bytes(reinterpret_cast<const char*>(&fixed), sizeof fixed);
  Append(grid.links, &bytes);
  Append(grid.records, &bytes);
  Append(state.second_moment, &bytes);
  return bytes;
}

std::optional<FitState> UnpackFitState(std::string_view bytes) {
  FixedPart fixed;
  if (bytes.size() < sizeof fixed) return std::nullopt;
  std::memcpy(static_cast<void*>(&fixed), bytes.data(), sizeof fixed);
  bytes.remove_prefix(sizeof fixed);
  if (fixed.version != kVersion || (fixed.basis != 1 && fixed.basis != 4 && fixed.basis != 9))
    return std::nullopt;
  FitState state;
  FastGrid& grid = state.grid;
  grid.basis = fixed.basis;
  grid.frame = fixed.frame;
  grid.background = fixed.background;
  grid.near_clip = fixed.near_clip;
  state.stage = fixed.stage;
  state.step = fixed.step;
  if (!Take(&bytes, fixed.links, &grid.links) || !Take(&bytes, fixed.records, &grid.records) ||
      !Take(&bytes, fixed.second_moment, &state.second_moment) || !bytes.empty())
    return std::nullopt;
  const int64_t voxels = grid.records.size() / grid.lanes();
  if (grid.links.size() != grid.frame.NumVertices() ||
      grid.records.size() != voxels * grid.lanes())
    return std::nullopt;
  for (const int32_t link : grid.links)
    if (link < -1 || link >= voxels) return std::nullopt;
  grid.vertex_of_voxel.Resize(voxels);
  RefreshDerived(&grid);
  return state;
}

}  // namespace regrade
