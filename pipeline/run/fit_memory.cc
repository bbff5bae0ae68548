#include "pipeline/run/fit_memory.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "pipeline/program/memory.h"
#include "reconstruct/fit/adapt_options.h"

namespace regrade {
namespace {

constexpr int64_t kLeastPhotos = 20;    // that are left of many
constexpr double kMostOfMemory = 0.75;  // for photos

int Finest(const FitOptions& options) { return *std::ranges::max_element(options.resolutions); }

uint64_t LimitOf(const FitPlace& place) {
  return PlannedMemory(place.max_memory_gb,
                       place.backend == Backend::kCuda
                           ? static_cast<uint64_t>(ReadDeviceStatus().free_bytes)
                           : ReadMemoryStatus().available);
}

bool MayLower(const FitPlace& place) { return !place.reproducible || place.max_memory_gb > 0; }

std::string ToFitInto(const FitPlace& place) {
  return std::string(" to fit into ") +
         (place.max_memory_gb > 0 ? "--max-memory" : "free memory");
}

const char* MemoryOf(const FitPlace& place) {
  return place.backend == Backend::kCuda ? "GPU memory" : "memory";
}

}  // namespace

bool LowerToMemory(const std::function<StagePlan(const FitOptions&)>& plan_of, uint64_t limit,
                   FitOptions* options) {
  bool lowered = false;
  while (limit > 0 && plan_of(*options).memory > limit) {
    auto& sides = options->resolutions;
    const int finest = *std::ranges::max_element(sides);
    if (finest <= kLeastResolution) break;
    const int lower = std::max(kLeastResolution, finest - std::max(1, finest / 16));
    for (auto* other : {&options->resolutions_y, &options->resolutions_z})
      for (size_t s = 0; s < other->size(); ++s)
        if (sides[s] > lower) (*other)[s] = std::max(2, (*other)[s] * lower / sides[s]);
    for (int& side : sides) side = std::min(side, lower);
    lowered = true;
  }
  return lowered;
}

bool LowerSplatsToMemory(const std::function<StagePlan(const SplatFitOptions&)>& plan_of,
                         uint64_t limit, SplatFitOptions* options) {
  bool lowered = false;
  while (limit > 0 && options->thousands > kLeastSplats && plan_of(*options).memory > limit) {
    options->thousands = std::max(kLeastSplats, std::floor(0.9f * options->thousands));
    lowered = true;
  }
  return lowered;
}

StagePlan PlanSplatsAt(const FitPlace& place, const SplatFitOptions& of_fit) {
  SplatFitOptions options = of_fit;
  options.thousands += static_cast<float>(place.frozen_splats) / 1000;
  return place.backend == Backend::kCuda
             ? PlanSplatFitOnDevice(options, place.pixels, place.photos)
             : PlanSplatFit(options, place.pixels, place.photos, omp_get_max_threads(),
                            place.is_block);
}

SplatFitOptions AtMostOfPixels(SplatFitOptions options, const FitPlace& place) {
  const float most = static_cast<float>(place.pixels / kPixelsOfSplat) / 1000;
  options.thousands =
      std::clamp(most, std::min(kLeastSplats, options.thousands), options.thousands);
  return options;
}

StagePlan PlanFitAt(const FitPlace& place, const FitOptions& options) {
  return place.backend == Backend::kCuda
             ? PlanFitOnDevice(options, place.pixels, place.box)
             : PlanFit(options, place.pixels, place.box, omp_get_max_threads());
}

FitOptions AdaptedTo(const FitOptions& options, const FitPlace& place) {
  return AdaptOptions(options,
                      {.on_card = place.backend == Backend::kCuda, .pixels = place.pixels});
}

int64_t OnePhotoIn(const FitPlace& place,
                   const std::function<StagePlan(const FitPlace&)>& plan) {
  if (place.max_memory_gb <= 0) return 1;
  FitPlace half = place;
  half.pixels /= 2, half.photos /= 2;
  const auto memory = [&plan](const FitPlace& of) {
    return static_cast<double>(plan(of).memory);
  };
  const double of_photos = 2 * (memory(place) - memory(half));
  const double room = kMostOfMemory * static_cast<double>(LimitOf(place));
  const double most =
      std::max(1.0, static_cast<double>(place.photos) / static_cast<double>(kLeastPhotos));
  return static_cast<int64_t>(std::clamp(std::ceil(of_photos / room), 1.0, std::floor(most)));
}

std::string FewerPhotosText(int64_t one_in, int64_t fitted, const FitPlace& place) {
  return Concat("one photo in ", one_in, " is fitted, ", fitted, " of ", place.photos, ",") +
         ToFitInto(place);
}

PlannedFit FitWithinMemory(FitOptions options, const FitPlace& place) {
  const auto plan_of = [&place](const FitOptions& of) { return PlanFitAt(place, of); };
  PlannedFit fit{std::move(options), {}, ""};
  const int finest = Finest(fit.options);
  if (MayLower(place) && LowerToMemory(plan_of, LimitOf(place), &fit.options))
    fit.notice = Concat("the finest grid has ", Finest(fit.options),
                        " voxels a side instead of ", finest) +
                 ToFitInto(place);
  fit.plan = plan_of(fit.options);
  CheckFitsMemory(fit.plan, LimitOf(place), MemoryOf(place));
  return fit;
}

PlannedSplatFit SplatsWithinMemory(SplatFitOptions options, const FitPlace& place,
                                   int64_t there) {
  const auto plan_of = [&place](const SplatFitOptions& of) { return PlanSplatsAt(place, of); };
  PlannedSplatFit fit{AtMostOfPixels(options, place), {}, ""};
  if (MayLower(place) && LowerSplatsToMemory(plan_of, LimitOf(place), &fit.options))
    fit.notice =
        Format("the field has at most %.0f thousand splats", double{fit.options.thousands}) +
        ToFitInto(place);
  fit.options.thousands = std::max(fit.options.thousands, static_cast<float>(there) / 1000);
  fit.plan = plan_of(fit.options);
  CheckFitsMemory(fit.plan, LimitOf(place), MemoryOf(place));
  return fit;
}

}  // namespace regrade
