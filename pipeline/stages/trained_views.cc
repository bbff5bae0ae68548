#include "pipeline/stages/trained_views.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/cpu/seen_by_cameras.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/text.h"
#include "pipeline/run/plan.h"

namespace regrade {
namespace {

constexpr uint64_t kGeometryBytes = 60;  // a splat of the file, while it is read
constexpr uint64_t kTrainedBytes = 450;  // a splat that is trained on
constexpr uint64_t kPictureBytes = 12;   // a pixel of a photo and its target

// 0 .. count - 1, each further one in the middle of the largest gap.
std::vector<int> Spread(int count) {
  std::vector<int> order;
  if (count > 0) order.push_back(0);
  for (int step = static_cast<int>(std::bit_ceil(static_cast<unsigned>(count))); step > 0;
       step /= 2)
    for (int i = step; i < count; i += 2 * step) order.push_back(i);
  return order;
}

}  // namespace

bool IsTrainedOnAPart(const RunSettings& settings, int64_t splats) {
  if (splats == 0 || settings.run.max_memory_gb <= 0) return false;
  if (settings.object.On() || settings.residual.On()) return false;
  return static_cast<uint64_t>(kProgramBytes) + kTrainedBytes * static_cast<uint64_t>(splats) >
         PlannedMemory(settings.run.max_memory_gb, 0);
}

std::vector<int> CamerasWithin(uint64_t memory, const RadianceField& splats,
                               const std::vector<Camera>& cameras) {
  const SplatsView<float> view = SplatsWithoutColors(splats.geometry->splats);
  const uint64_t all =
      static_cast<uint64_t>(kProgramBytes) + kGeometryBytes * static_cast<uint64_t>(view.count);
  std::vector<uint8_t> seen(static_cast<size_t>(view.count));
  uint64_t bytes = all;
  std::vector<int> within;
  for (const int i : Spread(static_cast<int>(cameras.size()))) {
    const Camera& camera = cameras[static_cast<size_t>(i)];
    bytes += kPictureBytes * static_cast<uint64_t>(camera.width) *
             static_cast<uint64_t>(camera.height);
    const std::vector<uint8_t> more = SeenSplats(view, {camera}, SplatOptionsOf(splats));
    for (size_t k = 0; k < seen.size(); ++k) {
      if (more[k] > seen[k]) bytes += kTrainedBytes;
      seen[k] |= more[k];
    }
    if (bytes > memory && !within.empty()) break;
    within.push_back(i);
  }
  std::ranges::sort(within);
  return within;
}

TrainedField ReadTrainedField(const RunContext& context, StoredField geometry,
                              const WorkingViews& views, std::vector<int> indices) {
  const std::string path = context.workspace->Path("field.npz");
  const int64_t splats = CountSplats(path);
  if (!IsTrainedOnAPart(context.settings, splats)) {
    geometry = {};
    return {ReadFieldFile(path), std::move(indices), ""};
  }
  std::vector<Camera> cameras;
  for (const int i : indices) cameras.push_back(views.CameraOf(i));
  const std::vector<int> within = CamerasWithin(
      PlannedMemory(context.settings.run.max_memory_gb, 0), geometry.field, cameras);
  TrainedField trained;
  for (const int k : within) trained.views.push_back(indices[static_cast<size_t>(k)]);
  std::vector<Camera> chosen;
  for (const int i : trained.views) chosen.push_back(views.CameraOf(i));
  trained.stored = SeenPart(std::move(geometry), path, chosen);
  trained.notice = Concat("the style is learned from ", trained.views.size(), " of ",
                          Counted(std::ssize(indices), "photo"), ", which show ",
                          trained.stored.field.geometry->num_voxels(), " of ", splats,
                          " splats, to fit into --max-memory");
  return trained;
}

}  // namespace regrade
