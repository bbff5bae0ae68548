#include "pipeline/study/duration_estimate.h"

#include <omp.h>

#include <algorithm>
#include <utility>

#include "pipeline/fields/film_timing.h"
#include "pipeline/run/plan.h"
#include "pipeline/stages/film_frames.h"

namespace regrade {
namespace {

std::string KeyOf(const std::string& benchmark, const std::string& parameter,
                  const std::string& value) {
  return benchmark + "\n" + parameter + "\n" + value;
}

}  // namespace

DurationEstimate::DurationEstimate(const RunSettings& base,
                                   const std::vector<Measurement>& measured,
                                   FitPlaceFunction place_of)
    : base_(base), place_of_(std::move(place_of)) {
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

double DurationEstimate::BaseSeconds(int64_t photos, bool style) const {
  const double fit = Seconds({"fit", "", ""});
  if (!style) return fit;
  // Of a megapixel: a frame of both fields with its pictures, one of the film by the fast
  // renderer, and a pair's flow and errors.
  constexpr double kFrame = 1.5, kFilmFrame = 0.8, kPair = 0.6;
  const auto megapixels = [](int side) { return 0.75e-6 * side * side; };
  const double samples = CountSamples(base_.render), views = static_cast<double>(photos);
  double seconds = kFrame * (views + samples);
  for (const int gap : base_.consistency.gaps)
    seconds += kPair * (std::max(0.0, views - gap) + std::max(0.0, samples - gap));
  seconds *= megapixels(base_.scene.photo_size);
  if (samples > 0)
    seconds += kFilmFrame * megapixels(base_.render.film_size) *
               FilmFrames(base_.render.film_seconds, base_.render.fps);
  return fit + Seconds({"style", "", ""}) + seconds;
}

double DurationEstimate::Rough(const Variant& variant) const {
  constexpr double kFewSeconds = 3, kPoses = 60;
  RunSettings settings = base_;
  OptionSet options;
  settings.Bind(&options);
  if (variant.benchmark == "fit" || variant.benchmark == "style")
    options.ApplyConfig(variant.options, "tradeoff");
  if (variant.benchmark == "fit")
    return FitKindOf(settings).plan(settings, place_of_(settings)).seconds;
  if (variant.benchmark == "style")
    return PlanStyle(settings.network, {},
                     0.75 * settings.scene.photo_size * settings.scene.photo_size, 0,
                     omp_get_max_threads())
        .seconds;
  return variant.benchmark == "poses" ? kPoses : kFewSeconds;
}

}  // namespace regrade
