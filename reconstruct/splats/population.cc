#include "reconstruct/splats/population.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/splats/splat_update.h"

namespace regrade {
namespace {

// Of a new opacity; a copy must not be dead, nor so opaque that its logit has no digits left.
constexpr double kLeastOpacity = kDeadOpacity, kMostOpacity = 1 - 1e-6;

// 0 for dead splats, which nothing is copied from.
std::vector<double> LiveOpacities(const std::vector<float>& logits) {
  std::vector<double> opacities(logits.size());
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < logits.size(); ++i) {
    const double opacity =
        std::isfinite(logits[i]) ? 1 / (1 + std::exp(-double{logits[i]})) : 0.0;
    opacities[i] = opacity < double{kDeadOpacity} ? 0 : opacity;
  }
  return opacities;
}

// Copies to the places `to`, of splats drawn by opacity.
PopulationChange CopyTo(const std::vector<double>& opacities, const std::vector<int32_t>& to,
                        uint64_t seed, uint64_t step) {
  PopulationChange change;
  change.count = std::ssize(opacities);
  std::vector<double> until(opacities.size());  // sum of the opacities up to each splat
  std::partial_sum(opacities.begin(), opacities.end(), until.begin());
  if (until.empty() || !(until.back() > 0)) return change;
  std::vector<int> copies(opacities.size());
  for (size_t k = 0; k < to.size(); ++k) {
    const double at = RandomDouble(seed ^ kRandomSplatSource, step, k) * until.back();
    const auto drawn = std::upper_bound(until.begin(), until.end() - 1, at);
    const size_t from = static_cast<size_t>(drawn - until.begin());
    if (copies[from] + 1 >= kMostCopies) continue;
    ++copies[from];
    change.copies.push_back({static_cast<int32_t>(from), to[k]});
  }
  for (size_t i = 0; i < opacities.size(); ++i) {
    if (copies[i] == 0) continue;
    const SplatCopies each =
        CopiesOf(std::clamp(opacities[i], kLeastOpacity, kMostOpacity), copies[i] + 1);
    const double opacity = std::clamp(each.opacity, kLeastOpacity, kMostOpacity);
    change.copied.push_back({static_cast<int32_t>(i),
                             static_cast<float>(std::log(opacity) - std::log1p(-opacity)),
                             static_cast<float>(each.log_scale)});
  }
  return change;
}

}  // namespace

PopulationChange MoveDead(const std::vector<float>& opacity_logits, uint64_t seed,
                          uint64_t step) {
  const std::vector<double> opacities = LiveOpacities(opacity_logits);
  std::vector<int32_t> dead;
  for (size_t i = 0; i < opacities.size(); ++i)
    if (opacities[i] == 0) dead.push_back(static_cast<int32_t>(i));
  return CopyTo(opacities, dead, seed, 2 * step);
}

PopulationChange Grow(const std::vector<float>& opacity_logits, int64_t more, uint64_t seed,
                      uint64_t step) {
  std::vector<int32_t> places(static_cast<size_t>(std::max<int64_t>(more, 0)));
  std::iota(places.begin(), places.end(), static_cast<int32_t>(opacity_logits.size()));
  PopulationChange change = CopyTo(LiveOpacities(opacity_logits), places, seed, 2 * step + 1);
  // Without gaps, where a draw was left out.
  for (size_t k = 0; k < change.copies.size(); ++k) change.copies[k].to = places[k];
  change.count += std::ssize(change.copies);
  return change;
}

PopulationChange Behind(int64_t before, PopulationChange change) {
  const int32_t by = static_cast<int32_t>(before);
  for (CopiedSplat& copied : change.copied) copied.index += by;
  for (SplatCopy& copy : change.copies) copy.from += by, copy.to += by;
  change.count += before;
  return change;
}

SplatCopies CopiesOf(double opacity, int copies) {
  REGRADE_CHECK(opacity > 0 && opacity < 1 && copies >= 1 && copies <= kMostCopies);
  const double each = -std::expm1(std::log1p(-opacity) / copies);
  double sum = 0, binomial = 1, power = 1;  // C(n, k + 1) and o'^(k + 1), signs apart
  for (int k = 0; k < copies; ++k) {
    binomial *= static_cast<double>(copies - k) / (k + 1);
    power *= each;
    sum += (k % 2 == 0 ? binomial : -binomial) * power / std::sqrt(k + 1.0);
  }
  return {each, std::log(opacity / sum)};
}

}  // namespace regrade
