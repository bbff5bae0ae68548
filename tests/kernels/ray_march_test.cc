// Rays against boxes and cells (hard cases H66, H71 to H83, H86, H94, H95).
#include "kernels/field/ray_march.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

// World = grid shifted by one half: the box is [0, n) in the world.
GridFrame UnitFrame(int n) {
  const float half = 0.5f * static_cast<float>(n);
  return {{n, n, n}, {half, half, half}, {half, half, half}};
}

int64_t Steps(const Vec3f& origin, const Vec3f& direction, int n = 8) {
  return ClipToGrid<float>(UnitFrame(n), {origin, direction}, 0.0f, 0.5f).num_steps;
}

TEST(RayMarch, H71_ParallelRayOutsideASlabMisses) {
  for (int axis = 0; axis < 3; ++axis)
    for (const float at : {-1.0f, 9.0f}) {
      Vec3f origin{4, 4, 4}, direction{0, 0, 0};
      origin[axis] = at;
      origin[(axis + 1) % 3] = -5;
      direction[(axis + 1) % 3] = 1;
      EXPECT_EQ(Steps(origin, direction), 0) << axis << " " << at;
      origin[axis] = 4;
      EXPECT_NEAR(Steps(origin, direction), 16, 1);  // the far face is widened by a rounding
    }
}

TEST(RayMarch, H72_FaceIsHalfOpen) {
  EXPECT_GT(Steps({0, -5, 4}, {0, 1, 0}), 0);  // on the low face: inside
  EXPECT_EQ(Steps({8, -5, 4}, {0, 1, 0}), 0);  // on the high face: outside
  EXPECT_EQ(Steps({8, -5, 8}, {0, 1, 0}), 0);  // on an edge
}

TEST(RayMarch, H73_StartInsideBeginsAtTheOriginOrTheNearClip) {
  const RayT<float> ray{{4, 4, 4}, {1, 0, 0}};
  EXPECT_EQ(ClipToGrid<float>(UnitFrame(8), ray, 0.0f, 0.5f).t_begin, 0.0f);
  EXPECT_EQ(ClipToGrid<float>(UnitFrame(8), ray, 1.5f, 0.5f).t_begin, 1.5f);
  EXPECT_EQ(ClipToGrid<float>(UnitFrame(8), ray, 100.0f, 0.5f).num_steps, 0);
}

TEST(RayMarch, H75_AnInvalidRayIsRefused) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(Steps({4, 4, 4}, {0, 0, 0}), 0);
  EXPECT_EQ(Steps({4, 4, 4}, {nan, 0, 1}), 0);
  EXPECT_EQ(Steps({4, inf, 4}, {1, 0, 0}), 0);
  EXPECT_EQ(Steps({nan, 4, 4}, {1, 0, 0}), 0);
}

TEST(RayMarch, H76_NegativeZeroIsZero) {
  EXPECT_EQ(Steps({4, -5, 4}, {-0.0f, 1, -0.0f}), Steps({4, -5, 4}, {0.0f, 1, 0.0f}));
  // On a face, where 0 / -0 would occur.
  EXPECT_EQ(Steps({0, -5, 4}, {-0.0f, 1, 0}), Steps({0, -5, 4}, {0.0f, 1, 0}));
}

// Halves of the box cover all rays of the whole box: none is lost between them (H74, H77).
TEST(RayMarch, H74_TwoHalvesCoverTheBox) {
  const GridFrame whole = UnitFrame(8);
  GridFrame low = whole, high = whole;
  low.resolution.x = high.resolution.x = 4;
  low.radius.x = high.radius.x = 2;
  low.center.x = 2;
  high.center.x = 6;
  int hits = 0;
  for (uint64_t i = 0; i < 100000; ++i) {
    const auto u = [&](int k) { return RandomDouble(3, 1, 8 * i + static_cast<uint64_t>(k)); };
    const Vec3d origin{20 * u(0) - 6, 20 * u(1) - 6, 20 * u(2) - 6};
    const Vec3d target{8 * u(3), 8 * u(4), 8 * u(5)};
    if (Norm(target - origin) < 1e-3) continue;
    const RayT<float> ray{origin.Cast<float>(), Normalized(target - origin).Cast<float>()};
    const bool in_whole = ClipToGrid(whole, ray, 0.0f, 0.5f).num_steps > 0;
    const bool in_halves = ClipToGrid(low, ray, 0.0f, 0.5f).num_steps > 0 ||
                           ClipToGrid(high, ray, 0.0f, 0.5f).num_steps > 0;
    ASSERT_TRUE(in_whole);  // the target is inside
    ASSERT_TRUE(in_halves) << i;
    ++hits;
  }
  EXPECT_GT(hits, 90000);
}

// Rays that graze an edge: an interval that is not empty in long double is not empty in float.
TEST(RayMarch, H77_NoGrazingRayIsLost) {
  int grazing = 0;
  for (uint64_t i = 0; i < 100000; ++i) {
    const auto u = [&](int k) { return RandomDouble(7, 1, 8 * i + static_cast<uint64_t>(k)); };
    Vec3d target{8 * u(0), 8 * u(1), 8 * u(2)};
    const int along = static_cast<int>(i % 3);
    // Outside one face and inside the other by the same sliver: the ray cuts the edge's corner.
    const double sliver = std::pow(10.0, -9 + 4 * u(3));
    target[(along + 1) % 3] = sliver;
    target[(along + 2) % 3] = sliver;
    Vec3d direction{0.1 * (u(4) - 0.5), 0.1 * (u(4) - 0.5), 0.1 * (u(4) - 0.5)};
    direction[(along + 1) % 3] = 0.2 + u(5);
    direction[(along + 2) % 3] = -0.2 - u(6);
    direction = Normalized(direction);
    const RayT<float> ray{(target - direction * (3 + 10 * u(7))).Cast<float>(),
                          direction.Cast<float>()};
    const GridRay<float> march = ClipToGrid(UnitFrame(8), ray, 0.0f, 0.5f);
    long double begin = 0, end = 1e30L;
    for (int a = 0; a < 3; ++a) {
      const long double inverse = 1.0L / march.direction[a];
      const long double t0 = (-0.5L - march.origin[a]) * inverse;
      const long double t1 = (7.5L - march.origin[a]) * inverse;
      begin = std::max(begin, std::min(t0, t1));
      end = std::min(end, std::max(t0, t1));
    }
    if (!(end > begin)) continue;
    grazing += end - begin < 1e-6L * end;
    ASSERT_GT(march.num_steps, 0) << i;
  }
  EXPECT_GT(grazing, 1000);
}

TEST(GridFrame, WorldAndGridAreInverse) {
  const GridFrame frame{{5, 9, 3}, {0.5f, -1, 2}, {1, 2, 0.5f}};
  for (const Vec3f g : {Vec3f{0, 0, 0}, Vec3f{4, 8, 2}, Vec3f{-0.5f, 8.5f, 1.25f}}) {
    const Vec3f world = frame.WorldOf(g);
    for (int a = 0; a < 3; ++a)
      EXPECT_NEAR(world[a] * frame.Scale()[a] + frame.Offset()[a], g[a], 1e-5);
  }
  // The box's faces are half a voxel outside the outermost vertices.
  EXPECT_NEAR(frame.WorldOf({-0.5f, 0, 0}).x, -0.5, 1e-6);
  EXPECT_NEAR(frame.WorldOf({4.5f, 0, 0}).x, 1.5, 1e-6);
}

TEST(RayMarch, H66_FarOriginNeitherLoopsNorDrifts) {
  const GridRay<float> ray =
      ClipToGrid<float>(UnitFrame(8), {{-1e8f, 4, 4}, {1, 0, 0}}, 0.0f, 1e-3f);
  EXPECT_LE(ray.num_steps, kMaxSteps);
  const GridRay<float> near =
      ClipToGrid<float>(UnitFrame(8), {{-1, 4, 4}, {1, 0, 0}}, 0.0f, 0.001f);
  // t_i = t_0 + i step: the last sample is accurate to a rounding; t += step would drift by
  // 0.016.
  const float last = near.t_begin + static_cast<float>(near.num_steps - 1) * 0.001f;
  EXPECT_NEAR(last, 1.0 + (near.num_steps - 1) * 0.001,
              testing::RecordBound("position of the last sample", testing::Computed::kFloat,
                                   last - (1.0 + (near.num_steps - 1) * 0.001), 1e-5));
  // A step below any rounding ends at the cap, not in a cast of 8e30 to an integer.
  EXPECT_EQ(ClipToGrid<float>(UnitFrame(8), {{-1, 4, 4}, {1, 0, 0}}, 0.0f, 1e-30f).num_steps,
            kMaxSteps);
}

TEST(Trilinear, H78_LastVertexIsReachedWithFractionOne) {
  const GridFrame frame = UnitFrame(5);
  const Cell<float> cell = LocateCell<float>(frame, {4, 4, 4});
  EXPECT_EQ(cell.vertex, frame.Vertex(3, 3, 3));
  EXPECT_EQ(cell.fraction, (Vec3f{1, 1, 1}));
  for (const float p : {std::nextafter(4.0f, 0.0f), std::nextafter(4.0f, 9.0f), 4.4f})
    EXPECT_EQ(LocateCell<float>(frame, {p, p, p}).vertex, frame.Vertex(3, 3, 3));
}

TEST(Trilinear, H80_NanPositionStaysInsideTheGrid) {
  const testing::MayBeNotFinite allowed;  // an ordered comparison with NaN is "invalid"
  const Cell<float> cell = LocateCell<float>(UnitFrame(5), {std::nanf(""), 2, 2});
  EXPECT_EQ(cell.vertex, UnitFrame(5).Vertex(0, 2, 2));
}

TEST(Trilinear, H81_WeightsSumToOneAndReproduceLinearFields) {
  const GridFrame frame = UnitFrame(4);
  std::vector<int32_t> links(64);
  std::vector<double> values(64);
  for (int i = 0; i < 64; ++i) {
    links[static_cast<size_t>(i)] = i;
    values[static_cast<size_t>(i)] = 2.0 * (i / 16) - 3.0 * (i / 4 % 4) + 0.5 * (i % 4) + 1;
  }
  for (uint64_t i = 0; i < 1000; ++i) {
    // The box extends half a voxel beyond its vertices; there the nearest face's values apply.
    Vec3d p{4 * RandomDouble(4, 0, 3 * i) - 0.5, 4 * RandomDouble(4, 0, 3 * i + 1) - 0.5,
            4 * RandomDouble(4, 0, 3 * i + 2) - 0.5};
    const Cell<double> cell = LocateCell(frame, p);
    for (int a = 0; a < 3; ++a) p[a] = std::clamp(p[a], 0.0, 3.0);
    double sum = 0, value;
    for (int k = 0; k < 8; ++k) {
      EXPECT_GE(CornerWeight(cell.fraction, k), 0);
      sum += CornerWeight(cell.fraction, k);
    }
    EXPECT_NEAR(
        sum, 1,
        testing::RecordDigits("sum of weights", testing::Computed::kDouble, sum - 1, 1e-15));
    Interpolate(frame, links.data(), values.data(), 1, 1, cell, &value);
    const double plane = 2 * p.x - 3 * p.y + 0.5 * p.z + 1;
    EXPECT_NEAR(value, plane,
                testing::RecordDigits("linear fields", testing::Computed::kDouble,
                                      value - plane, 1e-13));
  }
}

TEST(Trilinear, H82_H83_AdjointAndEmptyCorners) {
  const RadianceField field = testing::RandomField({6, 5, 7}, 4, 0.6, 8);
  const Geometry& g = *field.geometry;
  const int64_t n = g.num_voxels();
  std::vector<double> x(static_cast<size_t>(n) * 3), at_y(x.size());
  for (size_t i = 0; i < x.size(); ++i) x[i] = testing::Uniform(9, i, -1, 1);
  double ax_y = 0;
  for (uint64_t i = 0; i < 500; ++i) {
    const Vec3d p{5 * RandomDouble(5, 0, 3 * i), 4 * RandomDouble(5, 0, 3 * i + 1),
                  6 * RandomDouble(5, 0, 3 * i + 2)};
    const Cell<double> cell = LocateCell(g.frame, p);
    double out[3], y[3];
    Interpolate(g.frame, g.links.data(), x.data(), 3, 3, cell, out);
    for (int c = 0; c < 3; ++c) {
      y[c] = testing::Uniform(10, 3 * i + static_cast<uint64_t>(c), -1, 1);
      ax_y += out[c] * y[c];
    }
    InterpolateAdjoint(g.frame, g.links.data(), 3, 3, cell, y, at_y.data(), PlainAdd());
  }
  double x_aty = 0;
  for (size_t i = 0; i < x.size(); ++i) x_aty += x[i] * at_y[i];
  EXPECT_NEAR(ax_y, x_aty,
              testing::RecordDigits("adjoint", testing::Computed::kDouble, ax_y - x_aty, 1e-12,
                                    std::abs(ax_y) + 1));
}

TEST(Trilinear, H86_VertexIndexIs64Bit) {
  const GridFrame frame{{2048, 2048, 2048}, {0, 0, 0}, {1, 1, 1}};
  EXPECT_EQ(frame.NumVertices(), int64_t{1} << 33);
  EXPECT_EQ(frame.Vertex(2047, 2047, 2047), (int64_t{1} << 33) - 1);
}

TEST(SphericalHarmonics, H94_BandsHaveConstantPower) {
  for (uint64_t i = 0; i < 100000; ++i) {
    Vec3d d{RandomDouble(6, 0, 3 * i) - 0.5, RandomDouble(6, 0, 3 * i + 1) - 0.5,
            RandomDouble(6, 0, 3 * i + 2) - 0.5};
    if (i < 6) {
      d = {0, 0, 0};
      d[static_cast<int>(i / 2)] = i % 2 ? 1 : -1;
    }
    double gamma[9];
    ShBasis(9, Normalized(d), gamma);
    double power[3] = {};
    for (int k = 0; k < 9; ++k) power[k == 0 ? 0 : k < 4 ? 1 : 2] += gamma[k] * gamma[k];
    for (int l = 0; l < 3; ++l) {
      const double exact = (2 * l + 1) / (4 * M_PI);
      ASSERT_NEAR(power[l], exact,
                  testing::RecordDigits("power of a band", testing::Computed::kDouble,
                                        power[l] - exact, 1e-12));
    }
  }
}

TEST(SphericalHarmonics, H95_RaysOfEveryLensAreUnit) {
  // The basis expects unit directions: a length of 1.001 scales band 2 by 1.002. The camera
  // normalises rays once; rounding to float leaves an error of 2e-7 in the square.
  for (const LensModel lens : {LensModel::kPinhole, LensModel::kOpenCv, LensModel::kFisheye})
    for (const bool ndc : {false, true}) {
      Camera camera = testing::PinholeOf(400, 300, 300, 190, 160);
      camera.lens = lens;
      if (lens == LensModel::kOpenCv) camera.distortion = {-0.1, 0.02, 0.001, -0.002};
      if (ndc) camera.ndc = {1.5, 2};
      for (int y = 0; y < camera.height; y += 23)
        for (int x = 0; x < camera.width; x += 17) {
          const Vec3f d = camera.PixelRay(x, y).direction;
          ASSERT_NEAR(Dot(d, d), 1,
                      testing::RecordDigits("squared length of a ray",
                                            testing::Computed::kFloat, Dot(d, d) - 1, 1e-6))
              << x << " " << y;
        }
    }
}

}  // namespace
}  // namespace regrade
