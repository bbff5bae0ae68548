#include "pipeline/fields/fit_checkpoint.h"

namespace regrade {
namespace {

constexpr uint32_t kCheckpointVersion = 2;

bool Consistent(const FastGrid& grid) {
  if (grid.basis != 1 && grid.basis != 4 && grid.basis != 9) return false;
  const int64_t voxels = grid.records.size() / grid.lanes();
  for (int a = 0; a < 3; ++a)
    if (grid.frame.resolution[a] < 2 || grid.frame.resolution[a] > 1 << 14) return false;
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

void PackTally(const FitTally& tally, BytePacker* packer) {
  packer->Value(tally.window_error);
  packer->Value(tally.tail_error);
  for (const int64_t count :
       {tally.window_rays, tally.tail_rays, tally.rays, tally.samples, tally.rejected_voxels})
    packer->Value(count);
  packer->Value(static_cast<int64_t>(tally.curve.size()));
  for (const FitCurvePoint& point : tally.curve) {
    packer->Value(point.rays);
    packer->Value(point.seconds);
    packer->Value(point.psnr_train_db);
    packer->Value(point.step);
  }
}

void UnpackTally(ByteUnpacker* unpacker, FitTally* tally) {
  unpacker->Value(&tally->window_error);
  unpacker->Value(&tally->tail_error);
  for (int64_t* count : {&tally->window_rays, &tally->tail_rays, &tally->rays, &tally->samples,
                         &tally->rejected_voxels})
    unpacker->Value(count);
  int64_t points = 0;
  unpacker->Value(&points);
  for (int64_t i = 0; i < points && unpacker->ok(); ++i) {
    FitCurvePoint& point = tally->curve.emplace_back();
    unpacker->Value(&point.rays);
    unpacker->Value(&point.seconds);
    unpacker->Value(&point.psnr_train_db);
    unpacker->Value(&point.step);
  }
}

}  // namespace

BytePacker PackFitState(const FitState& state, const std::string& note) {
  const FastGrid& grid = state.grid;
  BytePacker packer;
  packer.Value(kCheckpointVersion);
  packer.Values(note);
  packer.Value(grid.basis);
  packer.Value(state.stage);
  packer.Value(state.step);
  for (int a = 0; a < 3; ++a) {
    packer.Value(grid.frame.resolution[a]);
    packer.Value(grid.frame.center[a]);
    packer.Value(grid.frame.radius[a]);
    packer.Value(grid.background[a]);
  }
  packer.Value(grid.near_clip);
  PackTally(state.tally, &packer);
  packer.Reference(grid.links);
  packer.Reference(grid.records);
  packer.Reference(state.second_moment);
  if (!grid.spheres.on()) return packer;
  packer.Value(grid.spheres.layers);
  packer.Value(grid.spheres.resolution);
  packer.Reference(grid.spheres.links);
  packer.Reference(grid.spheres.texels);
  packer.Reference(state.sphere_moment);
  return packer;
}

std::optional<FitState> UnpackFitState(std::string_view bytes, std::string* note) {
  ByteUnpacker unpacker(bytes);
  FitState state;
  FastGrid& grid = state.grid;
  uint32_t version = 0;
  unpacker.Value(&version);
  if (version != kCheckpointVersion) return std::nullopt;
  std::string unwanted;
  unpacker.Values(note != nullptr ? note : &unwanted);
  unpacker.Value(&grid.basis);
  unpacker.Value(&state.stage);
  unpacker.Value(&state.step);
  for (int a = 0; a < 3; ++a) {
    unpacker.Value(&grid.frame.resolution[a]);
    unpacker.Value(&grid.frame.center[a]);
    unpacker.Value(&grid.frame.radius[a]);
    unpacker.Value(&grid.background[a]);
  }
  unpacker.Value(&grid.near_clip);
  UnpackTally(&unpacker, &state.tally);
  unpacker.Values(&grid.links);
  unpacker.Values(&grid.records);
  unpacker.Values(&state.second_moment);
  if (unpacker.ok() && !unpacker.at_end()) {
    unpacker.Value(&grid.spheres.layers);
    unpacker.Value(&grid.spheres.resolution);
    unpacker.Values(&grid.spheres.links);
    unpacker.Values(&grid.spheres.texels);
    unpacker.Values(&state.sphere_moment);
    if (!Consistent(grid.spheres)) return std::nullopt;
  }
  if (!unpacker.at_end() || !Consistent(grid)) return std::nullopt;
  RefreshDerived(&grid);
  return state;
}

}  // namespace regrade
