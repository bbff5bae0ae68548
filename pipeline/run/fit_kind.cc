#include "pipeline/run/fit_kind.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
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

int64_t OnePhotoIn(const RunSettings& settings, const FitPlace& place) {
  if (settings.run.preset != "draft") return 1;
  return OnePhotoIn(place, [&settings](const FitPlace& of) {
    return FitKindOf(settings).plan(settings, of);
  });
}

FitInMemory Lowered(const RunSettings& settings, const FitPlace& place) {
  FitInMemory fit{place, settings, ""};
  const int64_t one_in = OnePhotoIn(settings, place);
  fit.place.pixels /= one_in;
  fit.place.photos = (place.photos + one_in - 1) / one_in;
  std::vector<std::string> sentences;
  if (one_in > 1) sentences.push_back(FewerPhotosText(one_in, fit.place.photos, place));
  if (const std::string lowered = FitKindOf(settings).lower(fit.place, &fit.settings);
      !lowered.empty())
    sentences.push_back(lowered);
  fit.notice = Join(sentences, "; ");
  return fit;
}

std::string MemoryWarning(const RunSettings& settings, const FitPlace& place) {
  try {
    return Lowered(settings, place).notice;
  } catch (const Error& error) {
    if (error.code() != ExitCode::kResources) throw;
    return error.what_failed() + (error.hint().empty() ? "" : ": " + error.hint());
  }
}

}  // namespace regrade
