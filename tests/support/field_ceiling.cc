#include "tests/support/field_ceiling.h"

#include <algorithm>
#include <cstdint>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/spherical_harmonics.h"
#include "stylize/field/residual_rays.h"

namespace regrade::testing {
namespace {

constexpr int kSteps = 60;

// Rays and coefficients [voxels, 3, harmonics] as a matrix: each ray's colour is linear in
// them.
class Coefficients {
 public:
  Coefficients(const RadianceField& field, const std::vector<Camera>& cameras,
               const std::vector<Image>& missing, int harmonics)
      : voxels_(field.geometry->num_voxels()), harmonics_(harmonics) {
    for (size_t i = 0; i < cameras.size(); ++i) {
      AddResidualRays(field, cameras[i], missing[i], int64_t{1} << 40, 0, &rays_);
      for (int y = 0; y < cameras[i].height; ++y)
        for (int x = 0; x < cameras[i].width; ++x) {
          gamma_.resize(gamma_.size() + 9);
          ShBasis(9, cameras[i].PixelRay(x, y).direction, &gamma_[gamma_.size() - 9]);
        }
    }
    REGRADE_CHECK_EQ(rays_.num_rays() * 9, std::ssize(gamma_));
  }

  const ResidualRays& rays() const { return rays_; }

  std::vector<Vec3d> Forward(const std::vector<double>& x) const {
    std::vector<Vec3d> colors(rays_.missing.size());
#pragma omp parallel for schedule(static)
    for (int64_t r = 0; r < rays_.num_rays(); ++r) {
      double sum[27] = {};
      for (int64_t i = rays_.first[r]; i < rays_.first[r + 1]; ++i)
        for (int k = 0; k < 3 * harmonics_; ++k)
          sum[k] += double{rays_.weight[i]} * x[3 * harmonics_ * int64_t{rays_.voxel[i]} + k];
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < harmonics_; ++k)
          colors[r][c] += double{gamma_[9 * r + k]} * sum[harmonics_ * c + k];
    }
    return colors;
  }

  std::vector<double> Adjoint(const std::vector<Vec3d>& colors) const {
    std::vector<double> x(3 * harmonics_ * voxels_);
    constexpr int kRanges = 16;
#pragma omp parallel for schedule(dynamic, 1)
    for (int range = 0; range < kRanges; ++range) {
      const int64_t begin = voxels_ * range / kRanges, end = voxels_ * (range + 1) / kRanges;
      for (int64_t r = 0; r < rays_.num_rays(); ++r) {
        // A ray's voxels are in order.
        const auto first = rays_.voxel.begin();
        auto at = std::lower_bound(first + rays_.first[r], first + rays_.first[r + 1], begin);
        for (; at != first + rays_.first[r + 1] && *at < end; ++at)
          for (int c = 0; c < 3; ++c)
            for (int k = 0; k < harmonics_; ++k)
              x[3 * harmonics_ * int64_t{*at} + harmonics_ * c + k] +=
                  double{rays_.weight[at - first]} * double{gamma_[9 * r + k]} * colors[r][c];
      }
    }
    return x;
  }

 private:
  int64_t voxels_;
  int harmonics_;
  ResidualRays rays_;
  std::vector<float> gamma_;  // [rays, 9]
};

double Square(const std::vector<double>& x) {
  double sum = 0;
  for (const double v : x) sum += v * v;
  return sum;
}

}  // namespace

std::vector<Image> RendersOf(const RadianceField& field, const std::vector<Camera>& cameras) {
  std::vector<Image> pictures;
  const FastGrid grid = MakeFastGrid(field);
  for (const Camera& camera : cameras)
    pictures.push_back(RenderView(grid, camera, MarchOptions{field.step}).color);
  return pictures;
}

RadianceField FieldCeiling(RadianceField field, const std::vector<Camera>& cameras,
                           const std::vector<Image>& missing, int harmonics) {
  const Coefficients matrix(field, cameras, missing, harmonics);
  std::vector<Vec3d> left;
  for (const Vec3f& t : matrix.rays().missing) left.push_back(t.Cast<double>());
  std::vector<double> x(3 * harmonics * field.geometry->num_voxels());
  std::vector<double> s = matrix.Adjoint(left), p = s;
  double gamma = Square(s);
  for (int step = 0; step < kSteps; ++step) {
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
  for (int64_t i = 0; i < std::ssize(x); ++i)
    field.appearance.sh[i / harmonics * 9 + i % harmonics] += static_cast<float>(x[i]);
  return field;
}

}  // namespace regrade::testing
