#include "reconstruct/refinement/lens_falloff.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "reconstruct/refinement/exposure_model.h"

namespace regrade {
namespace {

// Gains and falloff in turn; each round removes most of what is left of the other's error.
constexpr int kRounds = 30, kRoundsOfFold = 6;
constexpr double kFalloffConverged = 1e-4;  // change of log f(1)

struct Model {
  LogColors gains;
  LensFalloff falloff;
};

ExposureData Corrected(ExposureData data, const LensFalloff& falloff) {
  for (Observation& o : data.observations) {
    const double log = falloff.LogAt(o.radius2);
    o.log_light = o.log_light - Vec3d{log, log, log};
  }
  return data;
}

// Sums of the normal equations for a and b, with the points' colours eliminated.
struct Normal {
  double aa = 0, ab = 0, bb = 0, ya = 0, yb = 0;

  // The minimum among falloffs that never brighten outwards: a <= 0 and a + 2 b <= 0.
  LensFalloff Solve() const {
    const double det = aa * bb - ab * ab;
    if (det > 1e-9 * aa * bb) {
      const LensFalloff free{(bb * ya - ab * yb) / det, (aa * yb - ab * ya) / det};
      if (free.a <= 0 && free.a + 2 * free.b <= 0) return free;
    }
    // On the two edges of the cone: a = 0, or a = -2 b with b >= 0.
    const auto loss = [this](const LensFalloff& f) {
      return aa * f.a * f.a + 2 * ab * f.a * f.b + bb * f.b * f.b - 2 * (ya * f.a + yb * f.b);
    };
    const LensFalloff outer{0, bb > 0 ? std::min(0.0, yb / bb) : 0};
    const double along = 4 * aa - 4 * ab + bb;
    const double b = along > 0 ? std::max(0.0, (yb - 2 * ya) / along) : 0;
    const LensFalloff inner{-2 * b, b};
    return loss(outer) <= loss(inner) ? outer : inner;
  }
};

LensFalloff FalloffAt(const ExposureData& data, int without_fold, const Model& model) {
  const ExposureData corrected = Corrected(data, model.falloff);
  Normal sums;
  for (size_t p = 0; p + 1 < data.tracks.size(); ++p) {
    const size_t begin = data.tracks[p], end = data.tracks[p + 1];
    if (begin == end || data.fold_of_point[p] == without_fold) continue;
    const Vec3d color = RobustColor(corrected, p, model.gains);
    double weights = 0, mean_a = 0, mean_b = 0;
    Vec3d mean;
    std::vector<double> weight(end - begin);
    for (size_t i = begin; i < end; ++i) {
      const Observation& o = data.observations[i];
      const double w =
          ExposureWeight(corrected.observations[i].log_light - model.gains[o.view] - color);
      weight[i - begin] = w, weights += w;
      mean_a += w * o.radius2, mean_b += w * o.radius2 * o.radius2;
      mean += (o.log_light - model.gains[o.view]) * w;
    }
    mean_a /= weights, mean_b /= weights, mean = mean / weights;
    for (size_t i = begin; i < end; ++i) {
      const Observation& o = data.observations[i];
      const double w = weight[i - begin], a = o.radius2 - mean_a,
                   b = o.radius2 * o.radius2 - mean_b;
      const Vec3d left = o.log_light - model.gains[o.view] - mean;
      const double y = left.x + left.y + left.z;
      sums.aa += 3 * w * a * a, sums.ab += 3 * w * a * b, sums.bb += 3 * w * b * b;
      sums.ya += w * a * y, sums.yb += w * b * y;
    }
  }
  return sums.Solve();
}

Model Fit(const ExposureData& data, int without_fold, Model model, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    const double before = model.falloff.LogAt(1);
    model.gains = ReweightedGains(Corrected(data, model.falloff), without_fold, model.gains);
    model.falloff = FalloffAt(data, without_fold, model);
    if (std::abs(model.falloff.LogAt(1) - before) < kFalloffConverged) break;
  }
  return model;
}

double Sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

FalloffEstimate EstimateFalloff(int num_views,
                                const std::vector<ColorObservation>& observations) {
  FalloffEstimate estimate;
  const auto views = static_cast<size_t>(num_views);
  const ExposureData data = ArrangeObservations(views, observations);
  if (data.observations.empty()) return estimate;
  const LogColors alone = ReweightedGains(data, kNoFold, LogColors(views));
  const Model whole = Fit(data, kNoFold, {alone, {}}, kRounds);
  estimate.falloff = whole.falloff;
  estimate.corner = std::exp(whole.falloff.LogAt(1));

  std::vector<double> before(kExposureFolds), after(kExposureFolds), corners;
  for (int fold = 0; fold < kExposureFolds; ++fold) {
    const auto f = static_cast<size_t>(fold);
    const Model without = Fit(data, fold, whole, kRoundsOfFold);
    corners.push_back(std::exp(without.falloff.LogAt(1)));
    after[f] = Disagreement(Corrected(data, without.falloff), without.gains)[f];
    before[f] = Disagreement(data, ReweightedGains(data, fold, alone))[f];
  }
  estimate.corner_error = JackknifeError(corners);
  const double all_before = Sum(before), all_after = Sum(after);
  if (!(all_before > 0)) return estimate;
  estimate.explained = 1 - all_after / all_before;
  std::vector<double> without;
  for (size_t f = 0; f < before.size(); ++f)
    if (all_before - before[f] > 0)
      without.push_back(1 - (all_after - after[f]) / (all_before - before[f]));
  estimate.explained_error = JackknifeError(without);
  return estimate;
}

std::vector<ColorObservation> WithoutFalloff(std::vector<ColorObservation> observations,
                                             const LensFalloff& falloff) {
  for (ColorObservation& o : observations)
    o.light = o.light * std::exp(-falloff.LogAt(o.radius2));
  return observations;
}

}  // namespace regrade
