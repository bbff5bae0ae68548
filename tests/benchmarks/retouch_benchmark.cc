// How far a lifted edit is from its exact truth: rows for the best linear map, the 2D method,
// the network alone, the style with its residual, and the ceiling of any static field.
//
//   retouch_benchmark OUT GRADE STYLE EDITED
//
// OUT is the folder of a run on `regrade synth`'s still life, STYLE the style that `regrade
// retouch` made of its view number EDITED, graded as `--grade GRADE` does; the style was
// rendered. The truth is the grade of the unedited renders. The ceiling is the least squares of
// all voxels' coefficients to all true views, by conjugate gradients.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/field/spherical_harmonics.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/styled_field.h"
#include "stylize/field/residual_rays.h"
#include "tests/support/edit_truth.h"

namespace regrade {
namespace {

constexpr int kTerms = 27, kSteps = 60;

// Pictures of a field from all cameras.
std::vector<Image> Renders(const RadianceField& field, const std::vector<Camera>& cameras) {
  std::vector<Image> pictures;
  const FastGrid grid = MakeFastGrid(field);
  for (const Camera& camera : cameras)
    pictures.push_back(RenderView(grid, camera, MarchOptions{field.step}).color);
  return pictures;
}

// Rays and coefficients [voxels, 3, 9] as a matrix: each ray's colour is linear in them.
class Coefficients {
 public:
  Coefficients(const RadianceField& field, const std::vector<Camera>& cameras,
               const std::vector<Image>& missing)
      : voxels_(field.geometry->num_voxels()) {
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
      double sum[kTerms] = {};
      for (int64_t i = rays_.first[r]; i < rays_.first[r + 1]; ++i)
        for (int k = 0; k < kTerms; ++k)
          sum[k] += double{rays_.weight[i]} * x[kTerms * int64_t{rays_.voxel[i]} + k];
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 9; ++k) colors[r][c] += double{gamma_[9 * r + k]} * sum[9 * c + k];
    }
    return colors;
  }

  std::vector<double> Adjoint(const std::vector<Vec3d>& colors) const {
    std::vector<double> x(kTerms * voxels_);
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
            for (int k = 0; k < 9; ++k)
              x[kTerms * int64_t{*at} + 9 * c + k] +=
                  double{rays_.weight[at - first]} * double{gamma_[9 * r + k]} * colors[r][c];
      }
    }
    return x;
  }

 private:
  int64_t voxels_;
  ResidualRays rays_;
  std::vector<float> gamma_;  // [rays, 9]
};

double Square(const std::vector<double>& x) {
  double sum = 0;
  for (const double v : x) sum += v * v;
  return sum;
}

// The field whose coefficients are moved by least squares towards what is missing.
RadianceField Ceiling(RadianceField field, const std::vector<Camera>& cameras,
                      const std::vector<Image>& missing) {
  const Coefficients matrix(field, cameras, missing);
  std::vector<Vec3d> left;
  for (const Vec3f& t : matrix.rays().missing) left.push_back(t.Cast<double>());
  std::vector<double> x(kTerms * field.geometry->num_voxels());
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
  for (size_t i = 0; i < x.size(); ++i)
    field.appearance.sh[static_cast<int64_t>(i)] += static_cast<float>(x[i]);
  return field;
}

int Run(const std::string& out, const std::string& grade, const std::string& name, int edited) {
  const std::string style = out + "/styles/" + name;
  StoredField source = ReadFieldFile(out + "/field.npz");
  source.field.appearance = PadShBasis(std::move(source.field.appearance), 9);
  constexpr int kAnySize = 1 << 16;
  const WorkingViews views = ReadWorkingViews(out + "/poses", kAnySize, 0)
                                 .InField(source.field_from_world, source.ndc);
  const std::vector<Camera> cameras = views.Cameras();
  const testing::EditTruth truth(grade, Renders(source.field, cameras), edited);
  std::vector<Image> missing = truth.graded();
  for (size_t i = 0; i < missing.size(); ++i)
    for (size_t k = 0; k < missing[i].pixels.size(); ++k)
      missing[i].pixels[k] -= truth.renders()[i].pixels[k];
  const StoredNetwork network = ReadNetworkFile(style + "/network.npz");
  std::vector<Image> of_method;
  for (size_t i = 0; i < cameras.size(); ++i)
    of_method.push_back(
        ReadImage(style + "/frames/views_2d/" + Format("%05d.png", static_cast<int>(i))));

  const double linear = truth.ErrorsOf(truth.ByLinearMap()).inside;
  const double ceiling =
      truth.ErrorsOf(Renders(Ceiling(source.field, cameras, missing), cameras)).inside;
  const auto row = [&](const char* what, const std::vector<Image>& pictures) {
    const testing::EditErrors errors = truth.ErrorsOf(pictures);
    std::printf("| %s | %.2e | %.1f %% | %.2f |\n", what, errors.inside,
                100 * (linear - errors.inside) / (linear - ceiling), 255 * errors.outside);
  };
  std::printf("| %s | squared error inside | removed | change outside, of 255 |\n",
              grade.c_str());
  std::printf("|---|---|---|---|\n| best linear map | %.2e | 0 %% | |\n", linear);
  row("unedited", truth.renders());
  row("2D method on renders", of_method);
  row("network alone", Renders(StyledFieldOf(source, network, 1, nullptr).field, cameras));
  row("with residual", Renders(ReadStyledField(out, style, 1).field, cameras));
  std::printf("| ceiling | %.2e | 100 %% | |\n", ceiling);
  return 0;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: retouch_benchmark OUT GRADE STYLE EDITED\n");
    return 2;
  }
  try {
    return regrade::Run(argv[1], argv[2], argv[3], std::atoi(argv[4]));
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "retouch_benchmark: %s\n", error.what());
    return 1;
  }
}
