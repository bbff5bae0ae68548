#include "stylize/field/volume_variance.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "kernels/base/error.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/sample_basis.h"
#include "kernels/field/trilinear.h"
#include "kernels/render/ray_weigher.h"

namespace regrade {
namespace {

constexpr int32_t kBackground = -1;

struct Atom {
  int32_t voxel;  // kBackground behind the last one
  double weight;
  Vec3f direction;  // at which its colour is taken
};

// What one ray sees of the field before and after.
struct Seen {
  std::vector<Atom> atoms;                 // mu, front to back; weights sum to 1
  Vec3d source{}, styled{};                // as rendered
  Vec3d closed_source{}, closed_styled{};  // with mu for weights, nothing clamped
  Vec3f direction;                         // of the ray
  bool whole = false;                      // weights and transmittance make 1
  bool partial = false, on_sphere = false, transparent = false, clamped = false;
};

class Observer {
 public:
  Observer(const RadianceField& source, const RadianceField& styled,
           const LipschitzNetwork& network, const std::vector<float>* object_weights)
      : source_(source),
        styled_(styled),
        object_weights_(object_weights),
        basis_(source.appearance.basis),
        base_(network.data().base),
        has_base_(network.data().has_base),
        position_scale_(network.data().position_scale),
        base_norm_(network.BaseNorm()),
        residual_bound_(network.LearnedBound()) {
    REGRADE_CHECK(source.geometry == styled.geometry);
    REGRADE_CHECK_EQ(basis_, styled.appearance.basis);
    vertex_ = VertexOfVoxel(*source.geometry);
  }

  Seen Look(const Vec3f& direction, const RayWeights& weights, int64_t ray) const {
    Seen seen;
    seen.direction = direction;
    SampleBasis<double> basis(basis_, direction.Cast<double>(), weights);
    const double left = weights.transmittance[ray];
    seen.source = source_.background.Cast<double>() * left;
    seen.styled = styled_.background.Cast<double>() * left;
    double inside_weight = 0;
    for (int64_t i = weights.first[ray]; i < weights.first[static_cast<size_t>(ray) + 1]; ++i) {
      const WeightedSample& sample = weights.samples[i];
      const double* const gamma = basis.Of(i);
      const Vec3f& own =
          weights.directions.empty() ? direction : weights.directions[static_cast<size_t>(i)];
      Vec3d before{0.5, 0.5, 0.5}, after = before;
      int32_t points[8];
      CornerPoints(*source_.geometry, sample, points);
      seen.on_sphere |= sample.on_sphere();
      for (int corner = 0; corner < 8; ++corner) {
        const int32_t point = points[corner];
        const double fraction = CornerWeight(sample.fraction, corner);
        if (point < 0 || fraction == 0) continue;
        before += ColorOf(source_.appearance, point, gamma) * fraction;
        after += ColorOf(styled_.appearance, point, gamma) * fraction;
        if (sample.on_sphere()) continue;
        seen.partial |= object_weights_ != nullptr && (*object_weights_)[point] < 1;
        seen.atoms.push_back({point, fraction * sample.weight, own});
        inside_weight += fraction * sample.weight;
      }
      for (int c = 0; c < 3; ++c) {
        seen.clamped |= before[c] < 0 || after[c] < 0;
        seen.source[c] += sample.weight * std::max(before[c], 0.0);
        seen.styled[c] += sample.weight * std::max(after[c], 0.0);
      }
    }
    seen.transparent = !(inside_weight > 1 - kTransparentTransmittance);
    const double all = inside_weight + left;
    seen.whole = all > 1 - kTransparentTransmittance;
    if (!seen.whole) return seen;
    seen.atoms.push_back({kBackground, left, direction});
    for (Atom& atom : seen.atoms) {
      atom.weight /= all;
      if (atom.voxel == kBackground) {
        const Vec3d grey{0.5, 0.5, 0.5};  // which ColorOf leaves out
        seen.closed_source += (source_.background.Cast<double>() - grey) * atom.weight;
        seen.closed_styled += (styled_.background.Cast<double>() - grey) * atom.weight;
        continue;
      }
      double gamma[kMaxBasis];
      ShBasis(basis_, atom.direction.Cast<double>(), gamma);
      seen.closed_source += ColorOf(source_.appearance, atom.voxel, gamma) * atom.weight;
      seen.closed_styled += ColorOf(styled_.appearance, atom.voxel, gamma) * atom.weight;
    }
    return seen;
  }

  // The right side of EQ(vrr-bound).
  double Bound(const Seen& a, const Seen& b) const {
    double changed = 0, mean[3 * kMaxBasis] = {};
    const bool own_directions = KindOf(*source_.geometry).own_directions;
    const double gamma_norm = std::sqrt(basis_) * kSh0;
    Couple(a, b, [&](const Atom& one, const Atom& other, double moved) {
      if (one.voxel == kBackground || other.voxel == kBackground) {
        changed += moved * Norm(ResidualColor(one) - ResidualColor(other));
        return;
      }
      changed += moved * gamma_norm * residual_bound_ * Distance(one.voxel, other.voxel);
      double g[3 * kMaxBasis];
      Residual(other.voxel, g);
      if (own_directions) changed += moved * Turn(one.direction, other.direction) * NormOf(g);
      for (int i = 0; i < 3 * basis_; ++i) mean[i] += moved * g[i];
    });
    if (!own_directions) changed += Turn(a.direction, b.direction) * NormOf(mean);
    return base_norm_ * Norm(a.closed_source - b.closed_source) + changed;
  }
  // The mix of an object's style has the constant 1 - e + e K at most.
  double k() const {
    const double network = base_norm_ + residual_bound_;
    return object_weights_ != nullptr ? std::max(1.0, network) : network;
  }

 private:
  // Of a voxel, or of a texel of the spheres behind the voxels; without the constant 1/2.
  Vec3d ColorOf(const Appearance& appearance, int32_t point, const double* gamma) const {
    Vec3d color{};
    if (const int64_t texel = point - source_.geometry->num_voxels(); texel >= 0) {
      for (int c = 0; c < 3; ++c) color[c] = appearance.sphere_color[3 * texel + c] * gamma[0];
      return color;
    }
    const float* sh = appearance.sh.data() + static_cast<int64_t>(point) * appearance.stride();
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < basis_; ++k) color[c] += sh[c * basis_ + k] * gamma[k];
    return color;
  }

  // g of a voxel [3, basis]: what the network gave beyond the colour map.
  void Residual(int32_t voxel, double* g) const {
    const int64_t first = static_cast<int64_t>(voxel) * source_.appearance.stride();
    double mapped[3 * kMaxBasis] = {}, sh[3 * kMaxBasis];
    for (int i = 0; i < 3 * basis_; ++i) sh[i] = source_.appearance.sh[first + i];
    if (has_base_) MapCoefficients(base_, basis_, sh, mapped);
    for (int i = 0; i < 3 * basis_; ++i) g[i] = styled_.appearance.sh[first + i] - mapped[i];
  }

  // |Gamma(d_1) - Gamma(d_2)|
  double Turn(const Vec3f& one, const Vec3f& other) const {
    double a[kMaxBasis], b[kMaxBasis], sum = 0;
    ShBasis(basis_, one.Cast<double>(), a);
    ShBasis(basis_, other.Cast<double>(), b);
    for (int k = 0; k < basis_; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
    return std::sqrt(sum);
  }

  double NormOf(const double* g) const {
    double sum = 0;
    for (int i = 0; i < 3 * basis_; ++i) sum += g[i] * g[i];
    return std::sqrt(sum);
  }

  // What is added to the mapped colour: g Gamma(d), e of the background.
  Vec3d ResidualColor(const Atom& atom) const {
    Vec3d color;
    if (atom.voxel == kBackground) {
      color = styled_.background.Cast<double>();
      if (!has_base_) return color - Vec3d{0.5, 0.5, 0.5};
      return color - (base_.matrix * source_.background.Cast<double>() + base_.offset);
    }
    double g[3 * kMaxBasis], gamma[kMaxBasis];
    Residual(atom.voxel, g);
    ShBasis(basis_, atom.direction.Cast<double>(), gamma);
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < basis_; ++k) color[c] += g[c * basis_ + k] * gamma[k];
    return color;
  }

  double Distance(int32_t one, int32_t other) const {
    float x[kLargestRow.stride()], y[kLargestRow.stride()];
    FillFeatures(source_, position_scale_, one, vertex_[one], x);
    FillFeatures(source_, position_scale_, other, vertex_[other], y);
    double sum = 0;
    for (int i = 0; i < RowOf(basis_).inputs(); ++i) {
      const double d = static_cast<double>(x[i]) - static_cast<double>(y[i]);
      sum += d * d;
    }
    return std::sqrt(sum);
  }

  // Calls visit(j, k, pi_jk) of the coupling in the order of light.
  template <typename Visit>
  void Couple(const Seen& a, const Seen& b, const Visit& visit) const {
    double left_a = 0, left_b = 0;
    size_t i = 0, j = 0;
    while (true) {
      if (left_a <= 0) {
        if (i == a.atoms.size()) break;
        left_a = a.atoms[i++].weight;
      }
      if (left_b <= 0) {
        if (j == b.atoms.size()) break;
        left_b = b.atoms[j++].weight;
      }
      const double moved = std::min(left_a, left_b);
      if (moved > 0) visit(a.atoms[i - 1], b.atoms[j - 1], moved);
      left_a -= moved;
      left_b -= moved;
    }
  }

  const RadianceField& source_;
  const RadianceField& styled_;
  const std::vector<float>* object_weights_;  // may be null
  int basis_;
  ColorMap base_;
  bool has_base_;
  float position_scale_;
  double base_norm_, residual_bound_;
  std::vector<int32_t> vertex_;
};

// The first premise that either ray violates.
VarianceGroup VarianceReport::*GroupOf(const Seen& a, const Seen& b) {
  if (a.partial || b.partial) return &VarianceReport::partial;
  if (a.on_sphere || b.on_sphere) return &VarianceReport::spheres;
  if (a.transparent || b.transparent) return &VarianceReport::transparent;
  if (a.clamped || b.clamped) return &VarianceReport::clamped;
  return &VarianceReport::valid;
}

void Add(double source, double styled, double k, VarianceGroup* group) {
  ++group->pairs;
  group->sum_source += source;
  group->sum_styled += styled;
  const double excess = styled - k * source;
  group->above += excess > kVarianceSlack;
  group->largest_excess = std::max(group->largest_excess, excess);
}

}  // namespace

VarianceReport MeasureVariance(const RadianceField& source, const RadianceField& styled,
                               const LipschitzNetwork& network, const RayPairs& pairs,
                               RayWeigher* weigher, const std::vector<float>* object_weights) {
  if (object_weights != nullptr)
    REGRADE_CHECK_EQ(std::ssize(*object_weights), source.geometry->num_voxels());
  const RayWeights weights = weigher->Weigh(pairs);
  const Observer observer(source, styled, network, object_weights);
  struct Result {
    double source, styled, fraction;
    VarianceGroup VarianceReport::*group;
  };
  std::vector<Result> results(pairs.rays.size() / 2);
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t i = 0; i < results.size(); ++i) {
    const int64_t ray = 2 * static_cast<int64_t>(i);
    const Seen a = observer.Look(pairs.rays[2 * i].direction, weights, ray);
    const Seen b = observer.Look(pairs.rays[2 * i + 1].direction, weights, ray + 1);
    Result& result = results[i];
    result = {Norm(a.source - b.source), Norm(a.styled - b.styled), 0, GroupOf(a, b)};
    if (!(a.whole && b.whole) || a.clamped || b.clamped) continue;
    if (result.group != &VarianceReport::valid && result.group != &VarianceReport::transparent)
      continue;
    const double bound = observer.Bound(a, b);
    if (bound > kVarianceSlack)
      result.fraction = Norm(a.closed_styled - b.closed_styled) / bound;
  }
  VarianceReport report;
  report.k = observer.k();
  for (const Result& result : results) {
    Add(result.source, result.styled, report.k, &(report.*result.group));
    report.largest_fraction = std::max(report.largest_fraction, result.fraction);
  }
  return report;
}

}  // namespace regrade
