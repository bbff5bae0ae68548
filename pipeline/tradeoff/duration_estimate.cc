#include "pipeline/tradeoff/duration_estimate.h"

#include <omp.h>

#include <utility>

#include "pipeline/run/plan.h"
#include "reconstruct/fit/adapt_options.h"

namespace regrade {
namespace {

std::string KeyOf(const std::string& benchmark, const std::string& parameter,
                  const std::string& value) {
  return benchmark + "\n" + parameter + "\n" + value;
}

}  // namespace

DurationEstimate::DurationEstimate(const RunSettings& base,
                                   const std::vector<Measurement>& measured,
                                   FittedPixelsFunction pixels_of)
    : base_(base), pixels_of_(std::move(pixels_of)) {
  for (const Measurement& m : measured) Add(m);
}

void DurationEstimate::Add(const Measurement& m) {
  // These are seconds per frame or pair; the total is a few seconds and does not matter.
  if (m.benchmark == "render" || m.benchmark == "flow") return;
  last_[KeyOf(m.benchmark, m.parameter, m.value)] = m.seconds;
  if (!m.parameter.empty()) return;
  Sum& sum = benchmarks_[m.benchmark];
  sum.measured += m.seconds;
  sum.rough += Rough({m.benchmark, "", ""});
}

double DurationEstimate::Seconds(const Variant& variant) const {
  const auto last = last_.find(KeyOf(variant.benchmark, variant.parameter, variant.value));
  if (last != last_.end()) return last->second;
  const auto benchmark = benchmarks_.find(variant.benchmark);
  const double correction = benchmark != benchmarks_.end() && benchmark->second.rough > 0
                                ? benchmark->second.measured / benchmark->second.rough
                                : 1;
  return correction * Rough(variant);
}

double DurationEstimate::Rough(const Variant& variant) const {
  constexpr double kFewSeconds = 3, kPoses = 60;
  RunSettings settings = base_;
  OptionSet options;
  settings.Bind(&options);
  if (variant.benchmark == "fit" || variant.benchmark == "style")
    options.ApplyConfig(variant.options, "tradeoff");
  const int threads = omp_get_max_threads();
  if (variant.benchmark == "fit") {
    const int64_t pixels = pixels_of_(settings);
    return PlanFit(AdaptOptions(settings.fit, {.pixels = pixels}), pixels, SceneBox(), threads)
        .seconds;
  }
  if (variant.benchmark == "style") return PlanStyle(settings.network.steps, threads).seconds;
  return variant.benchmark == "poses" ? kPoses : kFewSeconds;
}

}  // namespace regrade
