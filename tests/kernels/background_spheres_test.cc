// Background spheres: ray crossings, the adjoint against derivatives, and the fast paths
// against the plain specification.
#include "kernels/field/background_spheres.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/sphere_variation.h"
#include "tests/support/derivative.h"
#include "tests/support/double_field.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::AddSpheres;
using testing::DerivativeBy;
using testing::DoubleField;
using testing::RandomField;
using testing::RandomRays;
using testing::ToDouble;
using testing::Uniform;

Vec3d RandomDirection(uint64_t seed, uint64_t counter) {
  const double z = Uniform(seed, 2 * counter, -1, 1), a = Uniform(seed, 2 * counter + 1, 0, 7);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

// Difference between the crossing and the quadratic's larger root in long double, relative to
// the radius. -1: neither finds a crossing ahead.
double CrossingError(const Vec3f& origin, const Vec3f& direction, double radius) {
  const GridFrame unit{{2, 2, 2}, {0, 0, 0}, {1, 1, 1}};
  const SphereRay<float> ray = ToSphereRay(unit, Ray{origin, direction});
  Vec3f place;
  float ahead;
  const bool crossed = CrossSphere(ray, static_cast<float>(1 / radius), &place, &ahead);
  using L = long double;
  const Vec3<L> o = origin.Cast<L>(), d = direction.Cast<L>();
  const L a = Dot(d, d), b = Dot(o, d), c = Dot(o, o) - L(radius) * L(radius);
  const L discriminant = b * b - a * c;
  const L t = discriminant < 0 ? L(-1) : (-b + std::sqrt(discriminant)) / a;
  if (!crossed || t <= 0) return -1;
  return static_cast<double>(Norm((o + d * t) / L(radius) - place.Cast<L>()));
}

// From inside every form is accurate; only float rounding remains.
TEST(BackgroundSpheres, H91_CrossingsFromInside) {
  for (int i = 0; i < 20000; ++i) {
    const uint64_t n = static_cast<uint64_t>(i);
    const double radius = std::pow(10.0, Uniform(3, n, 0, 4));
    const Vec3d origin = RandomDirection(1, n) * (radius * Uniform(4, n, 0, 0.999));
    const double error =
        CrossingError(origin.Cast<float>(), RandomDirection(2, n).Cast<float>(), radius);
    ASSERT_GE(error, 0) << i;
    // The stored inverse radius has a relative error of 6e-8, which moves a grazing crossing
    // more.
    ASSERT_LT(error, testing::RecordBound("a crossing, over the radius",
                                          testing::Computed::kFloat, error, 6e-6))
        << i;
  }
}

// From a hundred radii away rounding of the input alone is 6e-6 R; the quadratic's root loses
// 1.4e-3 R. Rays pass through the inner half, because grazing ones magnify the input's
// rounding.
TEST(BackgroundSpheres, H92_CrossingsFromFarOutside) {
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const uint64_t n = static_cast<uint64_t>(i);
    const Vec3d origin = RandomDirection(1, n) * 100.0;
    const Vec3d target = RandomDirection(2, n) * Uniform(3, n, 0, 0.5);
    const double error =
        CrossingError(origin.Cast<float>(), Normalized(target - origin).Cast<float>(), 1);
    ASSERT_GE(error, 0) << i;
    worst = std::max(worst, error);
  }
  EXPECT_LT(worst, testing::RecordBound("a crossing, over the radius",
                                        testing::Computed::kFloat, worst, 3e-5));
}

TEST(BackgroundSpheres, H93_OutsideTheInnerSpheresAndAtInfinity) {
  const GridFrame unit{{2, 2, 2}, {0, 0, 0}, {1, 1, 1}};
  Vec3d place;
  double ahead;
  // At infinity, r = 1 / 0, the crossing depends on the ray's direction only.
  const SphereRay<double> inside =
      ToSphereRay(unit, RayT<double>{{0.3, -0.2, 0.6}, {0.6, 0, 0.8}});
  ASSERT_TRUE(CrossSphere(inside, 0.0, &place, &ahead));
  EXPECT_NEAR(Norm(place - Vec3d{0.6, 0, 0.8}), 0,
              testing::RecordDigits("the crossing at infinity", testing::Computed::kDouble,
                                    Norm(place - Vec3d{0.6, 0, 0.8}), 1e-15));
  // From three radii away, facing outwards: nearer spheres are behind the camera.
  const SphereRay<double> out = ToSphereRay(unit, RayT<double>{{3, 0.1, 0}, {1, 0, 0}});
  EXPECT_FALSE(CrossSphere(out, 1.0, &place, &ahead));
  EXPECT_FALSE(CrossSphere(out, 1 / 2.9, &place, &ahead));
  ASSERT_TRUE(CrossSphere(out, 1 / 3.1, &place, &ahead));
  EXPECT_NEAR(ahead * 3.1, std::sqrt(3.1 * 3.1 - 0.01) - 3, 1e-12);
  // Facing inwards: all spheres that the ray crosses, at their far side.
  const SphereRay<double> in = ToSphereRay(unit, RayT<double>{{3, 0.1, 0}, {-1, 0, 0}});
  ASSERT_TRUE(CrossSphere(in, 1.0, &place, &ahead));
  EXPECT_LT(place.x, -0.99);
  // Past the centre: the inner spheres are missed, the outer ones crossed.
  const SphereRay<double> past = ToSphereRay(unit, RayT<double>{{3, 2, 0}, {-1, 0, 0}});
  EXPECT_FALSE(CrossSphere(past, 1.0, &place, &ahead));
  EXPECT_TRUE(CrossSphere(past, 0.4, &place, &ahead));
  // Layers seen by a camera far outside: finite, nothing in front of it.
  RadianceField field = RandomField({4, 4, 4}, 1, 0.0, 3);
  AddSpheres(16, 8, 1.0, 5, &field);
  for (const float away : {0.0f, 3.0f, 1e3f, 1e12f, 1e30f}) {
    const RayResult<float> result =
        RenderRay(ViewOf(field), Ray{{away, 0, 0}, {1, 0, 0}}, {0.5f, 0.0f});
    EXPECT_TRUE(AllFinite(result.color));
    EXPECT_TRUE(std::isfinite(result.depth));
    if (away > 100) {
      EXPECT_EQ(result.transmittance, 1) << away;  // the outermost layer is at 32 radii
    }
  }
}

TEST(BackgroundSpheres, TexelsAndDirectionsAreInverse) {
  const int r = 16;
  for (int x = 0; x < 2 * r; ++x)
    for (int y = 1; y < r; ++y) {
      const TexelCell<double> cell = LocateTexel(r, TexelDirection<double>(r, x, y));
      double here = 0, sum = 0;
      for (int k = 0; k < 4; ++k) {
        sum += cell.weight[k];
        if (cell.texel[k] == x * r + y) here += cell.weight[k];
      }
      EXPECT_NEAR(here, 1, 1e-9) << x << " " << y;
      EXPECT_NEAR(sum, 1, 1e-12);
    }
  // Across the seam and over the poles all texels are in the map.
  for (const Vec3f& d : {Vec3f{0, 1, 0}, Vec3f{0, -1, 0}, Vec3f{0, 0, -1}, Vec3f{-0.0f, 0, -1},
                         Vec3f{1e-20f, -1, 1e-20f}})
    for (const int32_t texel : LocateTexel(r, d).texel) {
      EXPECT_GE(texel, 0);
      EXPECT_LT(texel, 2 * r * r);
    }
}

// Compositing continues behind the box: white before white is white for any densities.
TEST(BackgroundSpheres, WeightsOfBoxAndLayersSumToOne) {
  RadianceField field = RandomField({6, 6, 6}, 1, 0.7, 11);
  AddSpheres(24, 12, 1.0, 12, &field);
  std::fill(field.appearance.sh.begin(), field.appearance.sh.end(), 0.0f);
  // Only blends of stored corners are white; an empty corner darkens.
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (float& density : geometry->density) density = -1;
  field.geometry = geometry;
  std::fill(field.appearance.sphere_color.begin(), field.appearance.sphere_color.end(),
            static_cast<float>(0.5 / kSh0));
  field.background = {1, 1, 1};
  for (const Ray& ray : RandomRays(200, 13)) {
    const RayResult<float> result = RenderRay(ViewOf(field), ray, {0.5f, 0.0f});
    EXPECT_LT(result.transmittance, 1);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(result.color[c], 1, 3e-6);
  }
}

// As FieldGradient.AdjointEqualsDerivativeInDouble, for all values of a field with layers.
TEST(BackgroundSpheres, AdjointEqualsDerivativeInDouble) {
  RadianceField field = RandomField({4, 4, 4}, 4, 0.3, 21);
  AddSpheres(6, 4, 0.9, 22, &field);
  DoubleField d(field);
  const MarchOptions options{0.5f, 1e-3f};
  const Vec3d d_color{0.8, -0.5, 0.3};
  int checked_layers = 0, checked_box = 0;
  for (const Ray& ray_f : RandomRays(16, 22)) {
    const RayT<double> ray = ToDouble(ray_f);
    const RayResult<double> result = RenderRay(d.view(), ray, options);
    std::vector<double> d_density(d.density.size()), d_sh(d.sh.size()),
        d_sphere_density(d.sphere_density.size()), d_sphere_color(d.sphere_color.size());
    RenderRayAdjoint(d.view(), ray, options, result, d_color, d_density.data(), d_sh.data(),
                     PlainAdd(), d_sphere_density.data(), d_sphere_color.data());
    const auto loss = [&] { return Dot(RenderRay(d.view(), ray, options).color, d_color); };
    const auto check = [&](double* x, double gradient) {
      const double numeric = DerivativeBy(x, loss, 2e-4, testing::kKink);
      if (std::isnan(numeric)) return 0;
      EXPECT_NEAR(numeric, gradient,
                  testing::RecordDigits("gradient of a pixel before spheres",
                                        testing::Computed::kDouble, numeric - gradient, 1e-8,
                                        1 + std::abs(gradient)));
      return gradient != 0 ? 1 : 0;
    };
    for (size_t i = 0; i < d.sphere_density.size(); ++i)
      checked_layers += check(&d.sphere_density[i], d_sphere_density[i]);
    for (size_t i = 0; i < d.sphere_color.size(); i += 2)
      checked_layers += check(&d.sphere_color[i], d_sphere_color[i]);
    for (size_t i = 0; i < d.density.size(); ++i)
      checked_box += check(&d.density[i], d_density[i]);
  }
  EXPECT_GT(checked_layers, 300);
  EXPECT_GT(checked_box, 50);
}

class FastSpheresParity : public ::testing::TestWithParam<std::tuple<const char*, int>> {
 protected:
  void SetUp() override {
    functions_ = FastRaysFor(std::get<0>(GetParam()));
    if (functions_ == nullptr)
      GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
    field_ = RandomField({9, 8, 10}, std::get<1>(GetParam()), 0.2, 41);
    AddSpheres(37, 16, 0.9, 42, &field_);  // not a multiple of the vector width
    rays_ = RandomRays(300, 43);
    for (int i = 0; i < 100; ++i)  // and rays from inside, outwards
      rays_.push_back({(RandomDirection(7, static_cast<uint64_t>(i)) * 0.8).Cast<float>(),
                       RandomDirection(8, static_cast<uint64_t>(i)).Cast<float>()});
  }

  const FastRayFunctions* functions_ = nullptr;
  RadianceField field_;
  std::vector<Ray> rays_;
};

// 2e-5 per pixel, as for the box; neighbouring texels that differ by 4 over a sixteenth of half
// a turn amplify an angle of 3e-7 to 1e-5.
TEST_P(FastSpheresParity, RendersAsThePlainRay) {
  const FastGrid grid = MakeFastGrid(field_);
  const MarchOptions options{0.5f, 1e-4f};
  const int64_t n = static_cast<int64_t>(rays_.size());
  std::vector<float> color(3 * rays_.size()), depth(rays_.size()), transmittance(rays_.size());
  functions_->render(grid, rays_.data(), n, options, color.data(), depth.data(),
                     transmittance.data());
  int behind = 0;
  for (size_t r = 0; r < rays_.size(); ++r) {
    const RayResult<float> plain = RenderRay(ViewOf(field_), rays_[r], options);
    behind += plain.spheres.last_layer >= 0;
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(
          color[3 * r + c], plain.color[c],
          testing::RecordBound("a pixel against the plain ray", testing::Computed::kFloat,
                               color[3 * r + c] - plain.color[c], 4e-5))
          << r;
    ASSERT_NEAR(transmittance[r], plain.transmittance, 2e-5);
    ASSERT_NEAR(depth[r], plain.depth, 1e-4 * (1 + plain.depth));
  }
  EXPECT_GT(behind, 200);
}

TEST_P(FastSpheresParity, GradientsAsThePlainAdjointInDouble) {
  const DoubleField d(field_);
  const FastGrid grid = MakeFastGrid(field_);
  const std::vector<Vec3f> targets(rays_.size(), Vec3f{0.4f, 0.5f, 0.2f});
  const MarchOptions options{0.5f, 1e-4f};
  GradientArena arena;
  arena.Reset(grid.num_voxels());
  arena.spheres.Reset(grid.spheres.num_texels());
  const float scale = 1.0f / 1200;
  functions_->accumulate(grid,
                         {rays_.data(), targets.data(), static_cast<int64_t>(rays_.size())},
                         options, scale, &arena);
  const testing::ExactGradient exact(d, rays_, targets, options, double{scale});
  const double most_density = testing::Largest(exact.sphere_density),
               most_color = testing::Largest(exact.sphere_color),
               most_voxel = testing::Largest(exact.density);
  ASSERT_GT(most_density, 0);
  for (int64_t t = 0; t < grid.spheres.num_texels(); ++t) {
    const int32_t slot = arena.spheres.slot_of_texel[t];
    const float* g = slot < 0 ? nullptr : arena.spheres.gradient.data() + 4 * slot;
    const double by_density = g ? g[3] : 0,
                 expected = exact.sphere_density[static_cast<size_t>(t)];
    ASSERT_NEAR(
        by_density, expected,
        testing::RecordDigits("gradient by texels, of its largest", testing::Computed::kFloat,
                              by_density - expected, 1e-4, most_density));
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(g ? g[c] : 0, exact.sphere_color[static_cast<size_t>(3 * t + c)],
                  1e-4 * most_color);
  }
  // The radiance behind the box enters the gradients of the box's densities.
  for (int64_t v = 0; v < grid.num_voxels(); ++v) {
    const int32_t slot = arena.slot_of_voxel[v];
    const float* g = slot < 0 ? nullptr : arena.gradient.data() + slot * grid.lanes();
    ASSERT_NEAR(g ? g[DensityLane(grid.basis)] : 0, exact.density[static_cast<size_t>(v)],
                1e-4 * most_voxel);
  }
}

INSTANTIATE_TEST_SUITE_P(Any, FastSpheresParity,
                         ::testing::Combine(::testing::Values("baseline", "avx2", "avx512"),
                                            ::testing::Values(1, 9)));

TEST(SphereVariation, GradientIsTheValuesDerivative) {
  RadianceField field = RandomField({2, 2, 2}, 1, 1.0, 61);
  AddSpheres(5, 6, 0.7, 62, &field);
  const SphereGeometry& spheres = field.geometry->spheres;
  std::vector<double> values(spheres.density.begin(), spheres.density.end());
  const auto value = [&](double scale, const auto& add) {
    return SphereVariation(spheres.layers, spheres.resolution, spheres.links.data(),
                           values.data(), 1, 0, 0, spheres.links.size(), scale, add);
  };
  std::vector<double> gradient(values.size());
  value(1.0, [&](int32_t texel, double d) { gradient[static_cast<size_t>(texel)] += d; });
  const auto nothing = [](int32_t, double) {};
  for (size_t i = 0; i < values.size(); ++i) {
    const double numeric = DerivativeBy(
        &values[i], [&] { return value(0.0, nothing); }, 2e-4);
    EXPECT_NEAR(numeric, gradient[i],
                testing::RecordDigits("gradient", testing::Computed::kDouble,
                                      numeric - gradient[i], 1e-8));  // see H97
  }
  // A constant background has no edge, also beside empty texels: only the roots of epsilon
  // remain.
  std::fill(values.begin(), values.end(), 3.0);
  EXPECT_NEAR(value(0.0, nothing), std::sqrt(1e-9) * static_cast<double>(values.size()), 1e-9);
}

}  // namespace
}  // namespace regrade
