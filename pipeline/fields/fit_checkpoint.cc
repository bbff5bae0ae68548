#include "pipeline/fields/fit_checkpoint.h"

#include "pipeline/files/byte_packing.h"

namespace regrade {
namespace {

constexpr uint32_t kVersion = 2;

bool Consistent(const FastGrid& grid) {
  if (grid.basis != 1 && grid.basis != 4 && grid.basis != 9) return false;
  for (int a = 0; a < 3; ++a)
    if (grid.frame.resolution[a] < 2 || grid.frame.resolution[a] > 1 << 14) return false;
  const int64_t voxels = grid.records.size() / grid.lanes();
  if (grid.links.size() != grid.frame.NumVertices() ||
      grid.records.size() != voxels * grid.lanes())
    return false;
  for (const int32_t link : grid.links)
    if (link < -1 || link >= voxels) return false;
  return true;
}

bool Consistent(const FastSpheres& spheres) {
  if (spheres.layers < 1 || spheres.layers > kMaxLayers || spheres.resolution < 2 ||
      spheres.resolution > kMaxSphereResolution)
    return false;
  if (spheres.links.size() != int64_t{2} * spheres.resolution * spheres.resolution ||
      spheres.texels.size() % (4 * spheres.layers) != 0)
    return false;
  const int64_t columns = spheres.num_texels() / spheres.layers;
  for (const int32_t link : spheres.links)
    if (link < -1 || link >= columns) return false;
  return true;
}

const FitCurvePoint& PointAt(const std::vector<FitCurvePoint>& curve, int64_t i) {
  return curve[i];
}
// The next one, in the order of reading.
FitCurvePoint& PointAt(std::vector<FitCurvePoint>& curve, int64_t) {
  return curve.emplace_back();
}

// Lists the members once for both directions. Returns whether there are background spheres.
template <typename Visitor, typename State>
bool Visit(Visitor* visit, State* state) {
  auto& grid = state->grid;
  visit->Value(&grid.basis);
  visit->Value(&state->stage);
  visit->Value(&state->step);
  for (int a = 0; a < 3; ++a) {
    visit->Value(&grid.frame.resolution[a]);
    visit->Value(&grid.frame.center[a]);
    visit->Value(&grid.frame.radius[a]);
    visit->Value(&grid.background[a]);
  }
  visit->Value(&grid.near_clip);
  auto& tally = state->tally;
  visit->Value(&tally.window_error);
  visit->Value(&tally.tail_error);
  for (auto* count : {&tally.window_rays, &tally.tail_rays, &tally.rays, &tally.samples,
                      &tally.rejected_voxels})
    visit->Value(count);
  int64_t points = std::ssize(tally.curve);
  visit->Value(&points);
  for (int64_t i = 0; i < points && visit->ok(); ++i) {
    auto& point = PointAt(tally.curve, i);
    visit->Value(&point.rays);
    visit->Value(&point.seconds);
    visit->Value(&point.psnr_train_db);
    visit->Value(&point.step);
  }
  visit->Values(&grid.links);
  visit->Values(&grid.records);
  visit->Values(&state->second_moment);
  if (!visit->More(grid.spheres.on())) return false;
  visit->Value(&grid.spheres.layers);
  visit->Value(&grid.spheres.resolution);
  visit->Values(&grid.spheres.links);
  visit->Values(&grid.spheres.texels);
  visit->Values(&state->sphere_moment);
  return true;
}

}  // namespace

std::string PackFitState(const FitState& state, const std::string& note) {
  const FastGrid& grid = state.grid;
  BytePacker packer;
  const size_t head =
      256 + note.size() + sizeof(FitCurvePoint) * state.tally.curve.size();  // upper bound
  packer.Reserve(head + sizeof(int32_t) * static_cast<size_t>(grid.links.size()) +
                 sizeof(float) * static_cast<size_t>(
                                     grid.records.size() + state.second_moment.size() +
                                     grid.spheres.links.size() + grid.spheres.texels.size() +
                                     state.sphere_moment.size()));
  packer.Value(&kVersion);
  packer.Values(&note);
  Visit(&packer, &state);
  return packer.Take();
}

std::optional<FitState> UnpackFitState(std::string_view bytes, std::string* note) {
  ByteUnpacker unpacker(bytes);
  uint32_t version = 0;
  unpacker.Value(&version);
  if (version != kVersion) return std::nullopt;
  std::string unwanted;
  unpacker.Values(note != nullptr ? note : &unwanted);
  FitState state;
  const bool spheres = Visit(&unpacker, &state);
  FastGrid& grid = state.grid;
  if (!unpacker.at_end() || !Consistent(grid) || (spheres && !Consistent(grid.spheres)))
    return std::nullopt;
  RefreshDerived(&grid);
  return state;
}

}  // namespace regrade
