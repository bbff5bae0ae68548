#include "pipeline/run/fit_kind.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/run/splat_fit.h"
#include "pipeline/run/voxel_fit.h"

namespace regrade {

const std::array<const FitKind*, 2>& FitKinds() {
  static constexpr std::array<const FitKind*, 2> kKinds{&kVoxelFit, &kSplatFit};
  return kKinds;
}

const FitKind& FitKindOf(const RunSettings& settings) {
  const auto kind = std::ranges::find_if(
      FitKinds(), [&](const FitKind* of) { return settings.scene.field == of->name; });
  REGRADE_CHECK(kind != FitKinds().end());
  return **kind;
}

std::string MemoryWarning(const RunSettings& settings, const FitPlace& place) {
  try {
    return FitKindOf(settings).lowered(settings, place);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kResources) throw;
    return error.what_failed() + (error.hint().empty() ? "" : ": " + error.hint());
  }
}

}  // namespace regrade
