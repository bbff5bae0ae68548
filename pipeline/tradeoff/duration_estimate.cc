#include "pipeline/tradeoff/duration_estimate.h"

#include <omp.h>

#include "pipeline/run/plan.h"

namespace regrade {
namespace {

std::string KeyOf(const std::string& plane, const std::string& knob, const std::string& value) {
  return plane + "\n" + knob + "\n" + value;
}

}  // namespace

Guess::Guess(const RunSettings& base, const std::vector<Measurement>& measured) : base_(base) {
  for (const Measurement& m : measured) Add(m);
}

void Guess::Add(const Measurement& m) {
  // Planes of frames and pairs are measured a piece; their few seconds do not matter.
  if (m.plane == "render" || m.plane == "flow") return;
  last_[KeyOf(m.plane, m.knob, m.value)] = m.seconds;
  if (!m.knob.empty()) return;
  Sum& sum = planes_[m.plane];
  sum.took += m.seconds;
  sum.rough += Rough({m.plane, "", ""});
}

double Guess::Seconds(const Variant& variant) const {
  const auto last = last_.find(KeyOf(variant.plane, variant.knob, variant.value));
  if (last != last_.end()) return last->second;
  const auto plane = planes_.find(variant.plane);
  const double off = plane != planes_.end() && plane->second.rough > 0
                         ? plane->second.took / plane->second.rough
                         : 1;
  return off * Rough(variant);
}

double Guess::Rough(const Variant& variant) const {
  constexpr double kFewSeconds = 3, kPoses = 60;
  RunSettings settings = base_;
  OptionSet options;
  settings.Bind(&options);
  if (variant.plane == "fit" || variant.plane == "style")
    options.ApplyConfig(variant.options, "tradeoff");
  const int threads = omp_get_max_threads();
  if (variant.plane == "fit") return PlanFit(settings.fit, 0, SceneBox(), threads).seconds;
  if (variant.plane == "style") return PlanStyle(settings.network.steps, threads).seconds;
  return variant.plane == "poses" ? kPoses : kFewSeconds;
}

}  // namespace regrade
