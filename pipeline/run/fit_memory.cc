#include "pipeline/run/fit_memory.h"

#include <omp.h>

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "pipeline/program/memory.h"

namespace regrade {
namespace {

int Finest(const FitOptions& options) { return *std::ranges::max_element(options.resolutions); }

}  // namespace

StagePlan PlanFitAt(const FitPlace& place, const FitOptions& options) {
  return place.backend == Backend::kCuda
             ? PlanFitOnDevice(options, place.pixels, place.box)
             : PlanFit(options, place.pixels, place.box, omp_get_max_threads());
}

PlannedFit FitWithinMemory(FitOptions options, const FitPlace& place) {
  const bool on_device = place.backend == Backend::kCuda, limited = place.max_memory_gb > 0;
  const uint64_t limit = PlannedMemory(
      place.max_memory_gb, on_device ? static_cast<uint64_t>(ReadDeviceStatus().free_bytes)
                                     : ReadMemoryStatus().available);
  const auto plan_of = [&place](const FitOptions& of) { return PlanFitAt(place, of); };
  PlannedFit fit{std::move(options), {}, ""};
  const int finest = Finest(fit.options);
  if ((!place.reproducible || limited) && LowerToMemory(plan_of, limit, &fit.options))
    fit.notice = (fit.options.adaptive() ? Format("the field has at most %.1f million cells",
                                                  double{fit.options.max_cells})
                                         : Concat("the finest grid has ", Finest(fit.options),
                                                  " voxels a side instead of ", finest)) +
                 " to fit into " + (limited ? "--max-memory" : "free memory");
  fit.plan = plan_of(fit.options);
  CheckFitsMemory(fit.plan, limit, on_device ? "GPU memory" : "memory");
  return fit;
}

std::string MemoryWarning(const FitOptions& options, const FitPlace& place) {
  try {
    return FitWithinMemory(options, place).notice;
  } catch (const Error& error) {
    if (error.code() != ExitCode::kResources) throw;
    return error.what_failed() + (error.hint().empty() ? "" : ": " + error.hint());
  }
}

}  // namespace regrade
