// The least squares of a field's coefficients to pictures.
#include "stylize/field/coefficient_fit.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "kernels/base/random.h"
#include "kernels/field/cpu/render_view.h"

namespace regrade {
namespace {

constexpr int kTerms = 27;

// A grey block of n^3 voxels with 9 harmonics; dense, so that rays see its surface only.
RadianceField Block(int n) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = {n, n, n};
  geometry->links.Resize(geometry->frame.NumVertices());
  geometry->density.Resize(geometry->links.size());
  for (int64_t v = 0; v < geometry->links.size(); ++v) {
    geometry->links[v] = static_cast<int32_t>(v);
    geometry->density[v] = 50;
  }
  RadianceField field;
  field.appearance.basis = 9;
  field.appearance.sh.Resize(kTerms * geometry->links.size());
  std::fill_n(field.appearance.sh.data(), field.appearance.sh.size(), 0.0f);
  field.geometry = std::move(geometry);
  return field;
}

// From three places.
std::vector<Camera> Cameras() {
  std::vector<Camera> cameras(3);
  for (int i = 0; i < 3; ++i) {
    cameras[i].width = 20, cameras[i].height = 16;
    cameras[i].fx = cameras[i].fy = 22;
    cameras[i].cx = 10, cameras[i].cy = 8;
    cameras[i].camera_from_world.translation = {0.3 * (i - 1), 0.1 * i, 3};
  }
  return cameras;
}

std::vector<Image> Renders(const RadianceField& field) {
  std::vector<Image> pictures;
  for (const Camera& camera : Cameras())
    pictures.push_back(RenderView(field, camera, field.march).color);
  return pictures;
}

std::vector<Image> Difference(std::vector<Image> a, const std::vector<Image>& b) {
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t k = 0; k < a[i].pixels.size(); ++k) a[i].pixels[k] -= b[i].pixels[k];
  return a;
}

double SquaredError(const std::vector<Image>& pictures, const std::vector<Image>& wanted) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < pictures.size(); ++i)
    for (size_t k = 0; k < pictures[i].pixels.size(); ++k) {
      if (!std::isfinite(wanted[i].pixels[k])) continue;
      sum += std::pow(double{pictures[i].pixels[k]} - wanted[i].pixels[k], 2);
      ++count;
    }
  return sum / count;
}

// Another field's pictures: colours and view dependence moved, within 0 and 1.
std::vector<Image> OtherPictures(const RadianceField& field) {
  RadianceField other = field;
  for (int64_t i = 0; i < other.appearance.sh.size(); ++i)
    other.appearance.sh[i] += static_cast<float>(0.2 * (RandomDouble(1, 0, i) - 0.5));
  return Renders(other);
}

TEST(CoefficientFit, ReachesWhatTheseVoxelsCanShow) {
  const RadianceField field = Block(8);
  const std::vector<Image> before = Renders(field), wanted = OtherPictures(field);
  const RadianceField fitted =
      FitCoefficients(field, Cameras(), Difference(wanted, before), {});
  const double first = SquaredError(before, wanted),
               last = SquaredError(Renders(fitted), wanted);
  EXPECT_GT(first, 1e-4);
  EXPECT_LT(last, 1e-6);  // 1e-3 a pixel: samples of a weight up to 1e-4 are left out
}

// Each view wants another colour everywhere, which no field shows to all pixels: at the end no
// direction of coefficients lowers the error.
TEST(CoefficientFit, NoOtherCoefficientsAreCloser) {
  const RadianceField field = Block(6);
  const std::vector<Image> before = Renders(field);
  std::vector<Image> wanted = before;
  for (size_t i = 0; i < wanted.size(); ++i)
    for (size_t k = 0; k < wanted[i].pixels.size(); ++k)
      wanted[i].pixels[k] += static_cast<float>(0.1 * (static_cast<double>(i) - 1) +
                                                0.1 * (RandomDouble(2, i, k) - 0.5));
  CoefficientFitOptions options{.steps = 400};
  const RadianceField fitted =
      FitCoefficients(field, Cameras(), Difference(wanted, before), options);
  const double least = SquaredError(Renders(fitted), wanted);
  EXPECT_LT(least, SquaredError(before, wanted));
  EXPECT_GT(least, 1e-6);  // something is left
  for (uint64_t direction = 0; direction < 8; ++direction) {
    const auto moved = [&](double scale) {
      RadianceField other = fitted;
      for (int64_t i = 0; i < other.appearance.sh.size(); ++i)
        other.appearance.sh[i] += static_cast<float>(
            scale * (RandomDouble(3, direction, static_cast<uint64_t>(i)) - 0.5));
      return SquaredError(Renders(other), wanted);
    };
    // The slope is far below the curvature: at 0.05 both sides are higher.
    EXPECT_GT(moved(0.05), least) << direction;
    EXPECT_GT(moved(-0.05), least) << direction;
  }
}

TEST(CoefficientFit, UnknownPixelsAndUnseenVoxelsStay) {
  const RadianceField field = Block(8);
  const std::vector<Image> before = Renders(field), wanted = OtherPictures(field);
  std::vector<Image> missing = Difference(wanted, before);
  for (Image& image : missing)  // the left half is unknown
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width / 2; ++x) image.at(x, y)[1] = std::nanf("");
  const RadianceField fitted = FitCoefficients(field, Cameras(), missing, {});
  int64_t moved = 0;
  for (int64_t i = 0; i < fitted.appearance.sh.size(); ++i) {
    ASSERT_TRUE(std::isfinite(fitted.appearance.sh[i])) << i;
    moved += fitted.appearance.sh[i] != 0;
  }
  EXPECT_GT(moved, 0);
  EXPECT_LT(moved, fitted.appearance.sh.size() * 2 / 3);  // what is inside no ray sees
  std::vector<Image> known = wanted;
  for (size_t i = 0; i < known.size(); ++i)
    for (size_t k = 0; k < known[i].pixels.size(); k += 3)
      if (std::isnan(missing[i].pixels[k + 1]))
        for (int c = 0; c < 3; ++c) known[i].pixels[k + c] = std::nanf("");
  EXPECT_LT(SquaredError(Renders(fitted), known), 1e-3 * SquaredError(before, known));
}

TEST(CoefficientFit, DoesNotDependOnTheThreadsAndStandsForFewRays) {
  const RadianceField field = Block(6);
  const std::vector<Image> before = Renders(field), wanted = OtherPictures(field);
  CoefficientFitOptions options;
  options.most_rays = 600;  // of 960
  const auto fit = [&](int threads) {
    const int own = omp_get_max_threads();
    omp_set_num_threads(threads);
    const RadianceField fitted =
        FitCoefficients(field, Cameras(), Difference(wanted, before), options);
    omp_set_num_threads(own);
    return fitted;
  };
  const RadianceField one = fit(1), three = fit(3);
  for (int64_t i = 0; i < one.appearance.sh.size(); ++i)
    ASSERT_EQ(one.appearance.sh[i], three.appearance.sh[i]) << i;
  EXPECT_LT(SquaredError(Renders(one), wanted), 0.5 * SquaredError(before, wanted));
}

// A field of fewer harmonics gets nine.
TEST(CoefficientFit, FewerHarmonicsArePadded) {
  RadianceField field = Block(4);
  Appearance plain;
  plain.basis = 1;
  plain.sh.Resize(3 * field.geometry->num_voxels());
  std::fill_n(plain.sh.data(), plain.sh.size(), 0.2f);
  field.appearance = plain;
  std::vector<Image> nothing;
  for (const Camera& camera : Cameras()) nothing.emplace_back(camera.width, camera.height, 3);
  const RadianceField fitted = FitCoefficients(field, Cameras(), nothing, {});
  EXPECT_EQ(fitted.appearance.basis, 9);
  EXPECT_EQ(Renders(fitted)[1].pixels, Renders(field)[1].pixels);
}

}  // namespace
}  // namespace regrade
