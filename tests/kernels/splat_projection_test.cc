// A splat's rotation and its ellipse on the screen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/splats/compositing.h"
#include "kernels/splats/projection.h"
#include "tests/support/derivative.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

using testing::Draw;
using testing::RandomSplats;
using testing::RoundedToFloat;
using testing::SplatCameraOf;

template <typename T>
Splat<T> CastSplat(const Splat<double>& splat) {
  return {splat.mean.Cast<T>(),
          splat.log_scale.Cast<T>(),
          {static_cast<T>(splat.quaternion[0]), static_cast<T>(splat.quaternion[1]),
           static_cast<T>(splat.quaternion[2]), static_cast<T>(splat.quaternion[3])},
          static_cast<T>(splat.opacity_logit)};
}

TEST(SplatRotation, AnyLengthOfAQuaternionGivesTheSameRotation) {
  for (uint64_t i = 0; i < 50; ++i) {
    double unit[4];
    for (uint64_t a = 0; a < 4; ++a) unit[a] = static_cast<float>(Draw(61, i, a, -1, 1));
    const Mat3d exact = RotationOf(unit);
    const Mat3d product = exact * exact.Transposed();
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(
            product(r, c), r == c,
            testing::RecordDigits("rotation times transposed", testing::Computed::kDouble,
                                  product(r, c) - (r == c), 2e-15));
    EXPECT_NEAR(exact.Determinant(), 1, 3e-15);
    for (const float length : {1e-29f, 1e-20f, 1.0f, 1e20f, 1e38f}) {
      float q[4];
      for (int a = 0; a < 4; ++a) q[a] = static_cast<float>(unit[a]) * length;
      const Mat3f got = RotationOf(q);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          // The scaled components are rounded, and some eight operations are.
          ASSERT_NEAR(got(r, c), exact(r, c),
                      testing::RecordDigits("rotation", testing::Computed::kFloat,
                                            got(r, c) - exact(r, c), 5e-7))
              << length;
    }
  }
}

TEST(SplatRotation, ZeroIsTheIdentityWithoutAGradient) {
  const float tiny = 1e-31f;
  for (const float w : {0.0f, tiny, -tiny}) {
    const float q[4] = {w, 0, tiny, 0};
    const Mat3f r = RotationOf(q);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) EXPECT_EQ(r(i, j), i == j);
    float d_q[4] = {};
    RotationAdjoint(q, Mat3f{{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}}, d_q);
    for (const float d : d_q) EXPECT_EQ(d, 0);
  }
}

TEST(SplatRotation, AdjointEqualsDerivativeInDouble) {
  for (uint64_t i = 0; i < 20; ++i) {
    double q[4], d_q[4] = {};
    for (uint64_t a = 0; a < 4; ++a) q[a] = Draw(62, i, a, -2, 2);
    Mat3d d;
    for (int k = 0; k < 9; ++k) d(k / 3, k % 3) = Draw(63, i, static_cast<uint64_t>(k), -1, 1);
    const auto loss = [&] {
      const Mat3d r = RotationOf(q);
      return Dot(r.row[0], d.row[0]) + Dot(r.row[1], d.row[1]) + Dot(r.row[2], d.row[2]);
    };
    RotationAdjoint(q, d, d_q);
    for (int a = 0; a < 4; ++a) {
      const double numeric = testing::DerivativeBy(&q[a], loss, 1e-3);
      EXPECT_NEAR(d_q[a], numeric,
                  testing::RecordDigits("gradient by quaternion", testing::Computed::kDouble,
                                        d_q[a] - numeric, 1e-9));
    }
  }
}

// S by its definition, all products formed, in long double.
struct Exact {
  long double xx, xy, yy, fitted;  // S, and det(A A^T + e I)
};
Exact ByDefinition(const Camera& camera, const SplatOptions& options,
                   const Splat<double>& splat) {
  const Mat3d r = RotationOf(splat.quaternion);
  const Vec3d p = camera.camera_from_world * splat.mean;
  const double half_x = 1.3 * camera.width / 2, half_y = 1.3 * camera.height / 2;
  const long double tx = std::clamp((long double)(p.x) / p.z,
                                    (camera.width / 2.0L - camera.cx - half_x) / camera.fx,
                                    (camera.width / 2.0L - camera.cx + half_x) / camera.fx);
  const long double ty = std::clamp((long double)(p.y) / p.z,
                                    (camera.height / 2.0L - camera.cy - half_y) / camera.fy,
                                    (camera.height / 2.0L - camera.cy + half_y) / camera.fy);
  const long double j[2][3] = {{camera.fx / (long double)p.z, 0, -camera.fx * tx / p.z},
                               {0, camera.fy / (long double)p.z, -camera.fy * ty / p.z}};
  const Mat3d& w = camera.camera_from_world.rotation;
  long double sigma[3][3] = {}, turned[3][3] = {}, s[2][2] = {};
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int k = 0; k < 3; ++k)
        sigma[a][b] +=
            (long double)r(a, k) * r(b, k) * expl(2 * (long double)splat.log_scale[k]);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l)
          turned[a][b] += (long double)w(a, k) * sigma[k][l] * w(b, l);
  for (int a = 0; a < 2; ++a)
    for (int b = 0; b < 2; ++b)
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l) s[a][b] += j[a][k] * turned[k][l] * j[b][l];
  const long double ratio = camera.fx * (long double)options.fit_pixel,
                    e = options.blur * ratio * camera.fy * options.fit_pixel,
                    blur = std::max((long double)options.blur, e);
  return {s[0][0] + blur, s[0][1], s[1][1] + blur,
          (s[0][0] + e) * (s[1][1] + e) - s[0][1] * s[0][1]};
}

TEST(SplatProjection, IsTheDefinitionsEllipse) {
  const Camera camera = SplatCameraOf(60, 40);
  SplatOptions options;
  const SplatArrays<double> splats = RandomSplats(300, 1, 64, 2.5);
  int limited = 0;
  for (const double focal :
       {std::numeric_limits<double>::infinity(), 150.0, 45.0, 15.0}) {  // of the fit, pixels
    options.fit_pixel = 1 / focal;
    for (int64_t i = 0; i < splats.count(); ++i) {
      const Splat<double> splat = splats.view()[i];
      SplatProjection<double> p;
      if (!ProjectSplat(SplatCamera(camera), options, splat, &p)) continue;
      limited += p.limited[0] || p.limited[1];
      double u, v, z;
      ASSERT_TRUE(camera.Project(splat.mean, &u, &v, &z));
      EXPECT_NEAR(p.ellipse.u, u, 1e-12 * (1 + std::abs(u)));
      EXPECT_NEAR(p.ellipse.v, v, 1e-12 * (1 + std::abs(v)));
      EXPECT_NEAR(p.at.z, z, 1e-15 * z);
      const Exact exact = ByDefinition(camera, options, splat);
      const ScreenEllipse<double>& e = p.ellipse;
      const long double scale = std::max(exact.xx, exact.yy);
      const auto near = [&](const char* what, double got, long double want, long double of) {
        const double off = static_cast<double>((got - want) / of);
        EXPECT_NEAR(off, 0,
                    testing::RecordDigits(what, testing::Computed::kDouble, off, 2e-14));
      };
      near("variance along x", e.c00 * e.c00, exact.xx, scale);
      near("covariance", e.c00 * e.c10, exact.xy, scale);
      near("variance along y", e.c10 * e.c10 + e.c11 * e.c11, exact.yy, scale);
      const long double det = exact.xx * exact.yy - exact.xy * exact.xy;
      near("determinant", e.c00 * e.c00 * e.c11 * e.c11, det, det);
      near("filter", e.filter, sqrtl(std::clamp(exact.fitted / det, 0.0L, 1.0L)), 1);
    }
  }
  EXPECT_GT(limited, 20);
}

// w of pixels near a splat, in float against double.
double WorstOffset(const SplatArrays<double>& splats, const Camera& camera, double* filter) {
  SplatOptions options{.fit_pixel = 0};
  double worst = 0;
  for (int64_t i = 0; i < splats.count(); ++i) {
    const Splat<double> exact_splat = splats.view()[i];
    SplatProjection<double> exact;
    SplatProjection<float> got;
    const bool seen = ProjectSplat(SplatCamera(camera), options, exact_splat, &exact);
    EXPECT_EQ(ProjectSplat(SplatCamera(camera), options, CastSplat<float>(exact_splat), &got),
              seen);
    if (!seen) continue;
    EXPECT_EQ(got.ellipse.u, exact.ellipse.u);
    EXPECT_EQ(got.ellipse.v, exact.ellipse.v);
    // Along the ellipse's long axis and beside it, to three deviations.
    for (const double along : {-2.0, -0.3, 0.0, 1.0})
      for (const double beside : {-2.0, 0.0, 0.7}) {
        const double dx = exact.ellipse.c00 * along,
                     dy = exact.ellipse.c10 * along + exact.ellipse.c11 * beside;
        double w[2];
        float w_got[2];
        exact.ellipse.Whiten(static_cast<float>(dx), static_cast<float>(dy), w);
        got.ellipse.Whiten(static_cast<float>(dx), static_cast<float>(dy), w_got);
        for (int a = 0; a < 2; ++a) worst = std::max(worst, std::abs(w_got[a] - w[a]));
      }
    *filter = std::max(*filter, std::abs(got.ellipse.filter / exact.ellipse.filter - 1));
  }
  return worst;
}

// A thousand times as long as the picture is wide, a millionth as thick as long: the offset of
// a pixel from the axis, in widths of the blurred needle, is right to the rounding of its
// direction over the picture. A stored inverse of S has lost all of it by then.
TEST(SplatProjection, NeedlesKeepTheirThinAxisInFloat) {
  const Camera camera = SplatCameraOf(400, 300);
  for (const double longest : {0.1, 10.0}) {
    SplatArrays<double> splats = RandomSplats(200, 1, 65);
    for (size_t i = 0; i < 600; ++i)
      splats.log_scale[i] = std::log(i % 3 == (i / 3) % 3 ? longest : 1e-6 * longest);
    splats = RoundedToFloat(splats);
    double filter = 0;
    const double worst = WorstOffset(splats, camera, &filter);
    // The longest is some 1e3 pixels on the screen, the blurred width 0.5.
    const double length = longest * camera.fx / 2;
    EXPECT_LE(worst, testing::RecordDigits("offset from a needle", testing::Computed::kFloat,
                                           worst, 1e-6, 1 + length / 0.5));
    EXPECT_LE(filter, testing::RecordDigits("filter of a needle", testing::Computed::kFloat,
                                            filter, 1e-6));
  }
}

// A disc seen edge-on: det(A A^T) is 0 up to the rounding of its normal, and the filter with
// it; S is the blur's across.
TEST(SplatProjection, ADiscSeenEdgeOnHasTheBlursWidth) {
  Camera camera = SplatCameraOf(60, 40);
  camera.camera_from_world.rotation = Mat3d();
  camera.camera_from_world.translation = {0, 0, 3};
  camera.cx = 30, camera.cy = 20;
  SplatOptions options{.fit_pixel = 0};
  const Splat<float> disc{{0, 0, 0}, {std::log(0.5f), -50, std::log(0.5f)}, {1, 0, 0, 0}, 4};
  SplatProjection<float> p;
  ASSERT_TRUE(ProjectSplat(SplatCamera(camera), options, disc, &p));
  EXPECT_NEAR(p.ellipse.c00, std::hypot(0.5 * camera.fx / 3, std::sqrt(0.3)), 1e-6);
  EXPECT_NEAR(p.ellipse.c11, std::sqrt(0.3), 1e-7);
  EXPECT_LT(p.ellipse.filter, 1e-20);
  float log_opacity, reach;
  EXPECT_FALSE(SplatReach(4.0f, p.ellipse.filter, &log_opacity, &reach));
}

// Logarithms of scales to both ends, in float: every number is finite, S is at least the blur,
// and a splat without size is the blur alone.
TEST(SplatProjection, ScalesOfAnySizeAreFiniteInFloat) {
  const Camera camera = SplatCameraOf(60, 40);
  SplatOptions options;
  for (const bool antialiased : {false, true}) {
    options.fit_pixel = antialiased ? 0 : -1;
    for (int code = 0; code < 27; ++code) {
      SplatArrays<double> splats = RandomSplats(40, 1, 66);
      for (int64_t i = 0; i < splats.count(); ++i) {
        Splat<float> splat = CastSplat<float>(splats.view()[i]);
        const float ends[3] = {-50, 0, 50};
        splat.log_scale = {ends[code % 3], ends[code / 3 % 3], ends[code / 9]};
        SplatProjection<float> p;
        if (!ProjectSplat(SplatCamera(camera), options, splat, &p)) continue;
        const ScreenEllipse<float>& e = p.ellipse;
        for (const float value : {e.c00, e.c10, e.c11, e.filter})
          ASSERT_TRUE(std::isfinite(value)) << code;
        const float root = std::sqrt(0.3f);
        ASSERT_GE(e.c00, root * 0.999999f);
        ASSERT_GE(e.c11, root * 0.999999f);
        if (code == 0) {
          ASSERT_FLOAT_EQ(e.c00, root);
          ASSERT_FLOAT_EQ(e.c11, root);
          ASSERT_LT(std::abs(e.c10), 1e-30f);
        }
        for (const Vec3f& b : p.b)
          for (int k = 0; k < 3; ++k) ASSERT_LE(std::abs(b[k]), 1.00001f);
        Splat<float> d{};
        EllipseSums<float> sums;
        sums.h[0] = 1, sums.h[1] = -2, sums.H[0] = 1, sums.H[1] = 0.5, sums.H[2] = 2;
        sums.f = e.filter > 0.01f ? 0.3f : 0.0f;  // what has less is not seen
        ProjectSplatAdjoint(SplatCamera(camera), options, splat, p, sums, 1.0f, &d);
        ASSERT_TRUE(AllFinite(d.mean) && AllFinite(d.log_scale)) << code;
        for (const float q : d.quaternion) ASSERT_TRUE(std::isfinite(q)) << code;
      }
    }
  }
}

// Means at the near plane, before it, behind the camera and at its centre.
TEST(SplatProjection, NearerThanTheNearPlaneIsLeftOut) {
  const Camera camera = SplatCameraOf(60, 40);
  const SplatOptions options;
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  SplatProjection<float> p;
  Splat<float> splat{{}, {4, 4, 4}, {1, 0, 0, 0}, 2};
  for (const double z : {-5.0, -0.2, 0.0, 0.1, 0.199}) {
    splat.mean = (world_from_camera * Vec3d{0.01, 0.02, z}).Cast<float>();
    EXPECT_FALSE(ProjectSplat(SplatCamera(camera), options, splat, &p)) << z;
  }
  for (const double z : {0.201, 0.5, 1e3, 1e20}) {
    splat.mean = (world_from_camera * Vec3d{0.01, 0.02, z}).Cast<float>();
    ASSERT_TRUE(ProjectSplat(SplatCamera(camera), options, splat, &p)) << z;
    EXPECT_TRUE(std::isfinite(p.ellipse.c00) && std::isfinite(p.ellipse.c11));
  }
  // Far beside the axis: a direction at right angles to it, nearly.
  splat.mean = (world_from_camera * Vec3d{3e5, 0, 0.21}).Cast<float>();
  EXPECT_FALSE(ProjectSplat(SplatCamera(camera), options, splat, &p));
}

// At the right end of a picture 16k wide, in float, as at its left end.
TEST(SplatProjection, WidePicturesKeepTheDigitsOfOffsets) {
  Camera camera = testing::PinholeOf(16384, 4, 9000);
  camera.camera_from_world.translation = {0, 0, 0};
  const SplatCamera own(camera);
  double worst = 0;
  for (uint64_t i = 0; i < 400; ++i) {
    const double z = Draw(68, i, 0, 1, 9);
    const double slope = Draw(68, i, 1, 0.89, 0.91) * (i % 2 ? 1 : -1);
    const float log_scale = static_cast<float>(std::log(z / 9000));
    Splat<float> splat{Vec3d{slope * z, 0, z}.Cast<float>(),
                       {log_scale, log_scale, log_scale},
                       {1, 0, 0, 0},
                       5};
    SplatProjection<float> got;
    ASSERT_TRUE(ProjectSplat(own, SplatOptions(), splat, &got));
    SplatProjection<double> exact;
    const Splat<double> same{
        splat.mean.Cast<double>(), splat.log_scale.Cast<double>(), {1, 0, 0, 0}, 5};
    ASSERT_TRUE(ProjectSplat(own, SplatOptions(), same, &exact));
    const int x = static_cast<int>(exact.ellipse.u), y = 1;
    SplatHit<float> hit;
    SplatHit<double> hit_exact;
    const bool seen = HitSplat(exact.ellipse, -0.1, 10.0, x, y, &hit_exact);
    ASSERT_EQ(HitSplat(got.ellipse, -0.1f, 10.0f, x, y, &hit), seen);
    if (seen) worst = std::max(worst, std::abs(hit.alpha / hit_exact.alpha - 1));
  }
  EXPECT_LE(worst, testing::RecordDigits("alpha at the right end", testing::Computed::kFloat,
                                         worst, 2e-6));
}

}  // namespace
}  // namespace regrade
