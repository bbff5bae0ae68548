#include "stylize/field/coefficient_fit.h"

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/field/spherical_harmonics.h"
#include "stylize/field/residual_rays.h"

namespace regrade {
namespace {

// The rays as a matrix on the coefficients [seen voxels, 3, kHarmonics].
template <int kHarmonics>
class Coefficients {
 public:
  static constexpr int kTerms = 3 * kHarmonics;

  Coefficients(const RadianceField& field, const std::vector<Camera>& cameras,
               const std::vector<Image>& missing, const CoefficientFitOptions& options) {
    const int64_t most = options.most_rays / std::max<int64_t>(1, std::ssize(cameras));
    for (size_t i = 0; i < cameras.size(); ++i)
      AddResidualRays(field, cameras[i], missing[i], most, options.seed + i, &rays_,
                      &directions_);
    of_entries_ = KindOf(*field.geometry).own_directions;
    harmonics_ = options.harmonics;
    // Most voxels are seen by no ray: memory follows those that are.
    std::vector<int32_t> place(static_cast<size_t>(field.geometry->num_voxels()), -1);
    for (const int32_t voxel : rays_.voxel) place[static_cast<size_t>(voxel)] = 0;
    for (size_t v = 0; v < place.size(); ++v) {
      if (place[v] < 0) continue;
      place[v] = static_cast<int32_t>(seen_.size());
      seen_.push_back(static_cast<int64_t>(v));
    }
    for (int32_t& voxel : rays_.voxel) voxel = place[static_cast<size_t>(voxel)];
  }

  const ResidualRays& rays() const { return rays_; }
  const std::vector<int64_t>& seen() const { return seen_; }
  size_t size() const { return kTerms * seen_.size(); }

  std::vector<Vec3d> Forward(const std::vector<double>& x) const {
    std::vector<Vec3d> colors(rays_.missing.size());
#pragma omp parallel for schedule(static)
    for (int64_t r = 0; r < rays_.num_rays(); ++r) {
      double sum[kTerms] = {};
      double gamma[kHarmonics];
      const auto add_color = [&](int64_t direction, const double* sh) {
        Gamma(direction, gamma);
        for (int c = 0; c < 3; ++c)
          for (int k = 0; k < kHarmonics; ++k)
            colors[r][c] += gamma[k] * sh[kHarmonics * c + k];
      };
      for (int64_t i = rays_.first[r]; i < rays_.first[r + 1]; ++i) {
        if (of_entries_) std::fill_n(sum, kTerms, 0.0);
        for (int k = 0; k < kTerms; ++k)
          sum[k] += double{rays_.weight[i]} * x[kTerms * int64_t{rays_.voxel[i]} + k];
        if (of_entries_) add_color(i, sum);
      }
      if (!of_entries_) add_color(r, sum);
    }
    return colors;
  }

  std::vector<double> Adjoint(const std::vector<Vec3d>& colors) const {
    std::vector<double> x(size());
    const int64_t voxels = std::ssize(seen_);
    constexpr int kRanges = 16;  // of voxels, so that sums have one order
#pragma omp parallel for schedule(dynamic, 1)
    for (int range = 0; range < kRanges; ++range) {
      const int64_t begin = voxels * range / kRanges, end = voxels * (range + 1) / kRanges;
      for (int64_t r = 0; r < rays_.num_rays(); ++r) {
        // A ray's voxels are in order.
        const auto first = rays_.voxel.begin();
        auto at = std::lower_bound(first + rays_.first[r], first + rays_.first[r + 1], begin);
        if (at == first + rays_.first[r + 1] || *at >= end) continue;
        double term[kTerms], gamma[kHarmonics];
        const auto find_terms = [&](int64_t direction) {
          Gamma(direction, gamma);
          for (int c = 0; c < 3; ++c)
            for (int k = 0; k < kHarmonics; ++k)
              term[kHarmonics * c + k] = gamma[k] * colors[r][c];
        };
        if (!of_entries_) find_terms(r);
        for (; at != first + rays_.first[r + 1] && *at < end; ++at) {
          if (of_entries_) find_terms(at - first);
          for (int k = 0; k < kTerms; ++k)
            x[kTerms * int64_t{*at} + k] += double{rays_.weight[at - first]} * term[k];
        }
      }
    }
    return x;
  }

 private:
  // [kHarmonics], as floats.
  void Gamma(int64_t direction, double* gamma) const {
    float values[kHarmonics];
    ShBasis(kHarmonics, directions_[static_cast<size_t>(direction)], values);
    for (int k = 0; k < kHarmonics; ++k) gamma[k] = k < harmonics_ ? double{values[k]} : 0;
  }

  ResidualRays rays_;  // `voxel` counts those of seen_
  std::vector<int64_t> seen_;
  std::vector<Vec3f> directions_;  // [rays], of splats of each entry
  bool of_entries_ = false;
  int harmonics_;
};

double Square(const std::vector<double>& x) {
  double sum = 0;
  for (const double v : x) sum += v * v;
  return sum;
}

// Conjugate gradients on the normal equations (Hestenes and Stiefel 1952), the residual kept.
template <int kHarmonics>
std::vector<double> Solve(const Coefficients<kHarmonics>& matrix, int steps,
                          const ProgressFunction& progress) {
  std::vector<Vec3d> left;
  for (const Vec3f& t : matrix.rays().missing) left.push_back(t.Cast<double>());
  std::vector<double> x(matrix.size());
  std::vector<double> s = matrix.Adjoint(left), p = s;
  double gamma = Square(s);
  for (int step = 0; step < steps; ++step) {
    ReportOrThrow(progress, step, steps);
    const std::vector<Vec3d> q = matrix.Forward(p);
    double along = 0;
    for (const Vec3d& v : q) along += Dot(v, v);
    if (!(along > 0)) break;
    const double a = gamma / along;
    for (size_t i = 0; i < x.size(); ++i) x[i] += a * p[i];
    for (size_t r = 0; r < left.size(); ++r) left[r] = left[r] - q[r] * a;
    s = matrix.Adjoint(left);
    const double next = Square(s);
    for (size_t i = 0; i < p.size(); ++i) p[i] = s[i] + next / gamma * p[i];
    gamma = next;
  }
  return x;
}

template <int kHarmonics>
RadianceField Fit(RadianceField field, const std::vector<Camera>& cameras,
                  const std::vector<Image>& missing, const CoefficientFitOptions& options,
                  const ProgressFunction& progress) {
  constexpr int kTerms = 3 * kHarmonics;
  field.appearance = PadShBasis(std::move(field.appearance), kHarmonics);
  const Coefficients<kHarmonics> matrix(field, cameras, missing, options);
  const std::vector<double> x = Solve(matrix, options.steps, progress);
  for (size_t v = 0; v < matrix.seen().size(); ++v)
    for (int k = 0; k < kTerms; ++k)
      field.appearance.sh[kTerms * matrix.seen()[v] + k] +=
          static_cast<float>(x[kTerms * v + static_cast<size_t>(k)]);
  return field;
}

}  // namespace

RadianceField FitCoefficients(RadianceField field, const std::vector<Camera>& cameras,
                              const std::vector<Image>& missing,
                              const CoefficientFitOptions& options,
                              const ProgressFunction& progress) {
  REGRADE_CHECK_EQ(cameras.size(), missing.size());
  const auto fit = field.appearance.basis > 9 ? Fit<kMaxBasis> : Fit<9>;
  return fit(std::move(field), cameras, missing, options, progress);
}

}  // namespace regrade
