#include "stylize/field/volume_variance.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/ray_weights.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

constexpr double kGammaNorm = 0.84628437532163443;  // sqrt(9 / (4 pi))

struct Atom {
  int32_t voxel;
  double weight;
};

// What one ray sees of the field before and after.
struct Seen {
  std::vector<Atom> atoms;                 // mu, front to back; weights sum to 1
  Vec3d source{}, styled{};                // as rendered
  Vec3d closed_source{}, closed_styled{};  // with mu for weights, nothing clamped
  double gamma[kMaxBasis] = {};
  bool transparent = false, clamped = false;
};

class Observer {
 public:
  Observer(const RadianceField& source, const RadianceField& styled,
           const LipschitzNetwork& network)
      : source_(source),
        styled_(styled),
        basis_(source.appearance.basis),
        base_(network.data().base),
        has_base_(network.data().has_base),
        position_scale_(network.data().position_scale),
        base_norm_(network.BaseNorm()),
        residual_bound_(network.ResidualBound()) {
    REGRADE_CHECK(source.geometry == styled.geometry);
    REGRADE_CHECK_EQ(basis_, styled.appearance.basis);
    vertex_ = VertexOfVoxel(*source.geometry);
  }

  Seen Look(const Vec3f& direction, const RayWeights& weights, int64_t ray) const {
    Seen seen;
    ShBasis(basis_, direction.Cast<double>(), seen.gamma);
    const double left = weights.transmittance[ray];
    seen.source = source_.background.Cast<double>() * left;
    seen.styled = styled_.background.Cast<double>() * left;
    double inside_weight = 0;
    for (int64_t i = weights.first[ray]; i < weights.first[static_cast<size_t>(ray) + 1]; ++i) {
      const WeightedSample& sample = weights.samples[i];
      Vec3d before{0.5, 0.5, 0.5}, after = before;
      int32_t voxels[8];
      CornerPoints(*source_.geometry, sample, voxels);
      for (int corner = 0; corner < 8; ++corner) {
        const int32_t voxel = voxels[corner];
        const double fraction = CornerWeight(sample.fraction, corner);
        if (voxel < 0 || fraction == 0) continue;
        before += ColorOf(source_.appearance, voxel, seen.gamma) * fraction;
        after += ColorOf(styled_.appearance, voxel, seen.gamma) * fraction;
        seen.atoms.push_back({voxel, fraction * sample.weight});
        inside_weight += fraction * sample.weight;
      }
      for (int c = 0; c < 3; ++c) {
        seen.clamped |= before[c] < 0 || after[c] < 0;
        seen.source[c] += sample.weight * std::max(before[c], 0.0);
        seen.styled[c] += sample.weight * std::max(after[c], 0.0);
      }
    }
    seen.transparent = !(inside_weight > 1 - kTransparentTransmittance);
    for (Atom& atom : seen.atoms) {
      atom.weight /= inside_weight;
      seen.closed_source += ColorOf(source_.appearance, atom.voxel, seen.gamma) * atom.weight;
      seen.closed_styled += ColorOf(styled_.appearance, atom.voxel, seen.gamma) * atom.weight;
    }
    return seen;
  }

  // The right side of EQ(vrr-bound).
  double Bound(const Seen& a, const Seen& b) const {
    double difference = 0;
    for (int k = 0; k < basis_; ++k)
      difference += (a.gamma[k] - b.gamma[k]) * (a.gamma[k] - b.gamma[k]);
    return base_norm_ * Norm(a.closed_source - b.closed_source) +
           kGammaNorm * residual_bound_ * Transport(a, b) +
           ResidualNorm(b) * std::sqrt(difference);
  }
  double k() const { return base_norm_ + residual_bound_; }

 private:
  Vec3d ColorOf(const Appearance& appearance, int32_t voxel, const double* gamma) const {
    const float* sh = appearance.sh.data() + static_cast<int64_t>(voxel) * appearance.stride();
    Vec3d color{};
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

  double ResidualNorm(const Seen& seen) const {
    double sum[3 * kMaxBasis] = {}, norm = 0;
    for (const Atom& atom : seen.atoms) {
      double g[3 * kMaxBasis];
      Residual(atom.voxel, g);
      for (int i = 0; i < 3 * basis_; ++i) sum[i] += atom.weight * g[i];
    }
    for (int i = 0; i < 3 * basis_; ++i) norm += sum[i] * sum[i];
    return std::sqrt(norm);
  }

  double Distance(int32_t one, int32_t other) const {
    float x[kFeatureStride], y[kFeatureStride];
    FillFeatures(source_, position_scale_, one, vertex_[one], x);
    FillFeatures(source_, position_scale_, other, vertex_[other], y);
    double sum = 0;
    for (int i = 0; i < kNetworkInputs; ++i) {
      const double d = static_cast<double>(x[i]) - static_cast<double>(y[i]);
      sum += d * d;
    }
    return std::sqrt(sum);
  }

  // sum pi_jk |x_j - x_k| of the coupling in the order of light.
  double Transport(const Seen& a, const Seen& b) const {
    double cost = 0, left_a = 0, left_b = 0;
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
      if (moved > 0) cost += moved * Distance(a.atoms[i - 1].voxel, b.atoms[j - 1].voxel);
      left_a -= moved;
      left_b -= moved;
    }
    return cost;
  }

  const RadianceField& source_;
  const RadianceField& styled_;
  int basis_;
  ColorMap base_;
  bool has_base_;
  float position_scale_;
  double base_norm_, residual_bound_;
  std::vector<int32_t> vertex_;
};

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
                               const LipschitzNetwork& network,
                               const std::vector<RayPair>& pairs, const MarchOptions& march) {
  std::vector<Ray> rays;
  for (const RayPair& pair : pairs) rays.insert(rays.end(), {pair.first, pair.second});
  const RayWeights weights = ComputeRayWeights(
      *source.geometry, {rays.data(), std::ssize(rays)}, march, source.near_clip);
  const Observer observer(source, styled, network);
  struct Result {
    double source, styled, fraction;
    bool transparent, clamped;
  };
  std::vector<Result> results(pairs.size());
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t i = 0; i < pairs.size(); ++i) {
    const int64_t ray = 2 * static_cast<int64_t>(i);
    const Seen a = observer.Look(pairs[i].first.direction, weights, ray);
    const Seen b = observer.Look(pairs[i].second.direction, weights, ray + 1);
    Result& result = results[i];
    result = {Norm(a.source - b.source), Norm(a.styled - b.styled), 0,
              a.transparent || b.transparent, a.clamped || b.clamped};
    if (result.transparent || result.clamped) continue;
    const double bound = observer.Bound(a, b);
    if (bound > kVarianceSlack)
      result.fraction = Norm(a.closed_styled - b.closed_styled) / bound;
  }
  VarianceReport report;
  report.k = observer.k();
  for (const Result& result : results) {
    Add(result.source, result.styled, report.k,
        result.transparent ? &report.transparent
        : result.clamped   ? &report.clamped
                           : &report.valid);
    report.largest_fraction = std::max(report.largest_fraction, result.fraction);
  }
  return report;
}

std::vector<RayPair> NeighbouringPixels(const std::vector<Camera>& cameras, int64_t count,
                                        uint64_t seed) {
  REGRADE_CHECK(!cameras.empty());
  constexpr uint64_t kStream = 0x7661726961;
  std::vector<RayPair> pairs;
  for (int64_t i = 0; i < count; ++i) {
    const auto draw = [&](int which, int below) {
      return static_cast<int>(RandomIndex(seed, kStream, static_cast<uint64_t>(4 * i + which),
                                          static_cast<uint64_t>(below)));
    };
    const Camera& camera = cameras[draw(0, static_cast<int>(cameras.size()))];
    const bool down = draw(1, 2) == 1;
    const int right = down ? 0 : 1, below = down ? 1 : 0;
    if (camera.width <= right || camera.height <= below) continue;
    const int x = draw(2, camera.width - right), y = draw(3, camera.height - below);
    pairs.emplace_back(camera.PixelRay(x, y), camera.PixelRay(x + right, y + below));
  }
  return pairs;
}

}  // namespace regrade
