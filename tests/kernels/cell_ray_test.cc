// What a device's thread does for a pixel of an adaptive field, run on the host.
#include "kernels/field/cuda/cell_ray.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "kernels/field/field_seen_by.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render_ray.h"
#include "tests/support/cell_field.h"
#include "tests/support/device_rays_on_host.h"

namespace regrade {
namespace {

using testing::ColorsOf;
using testing::HostView;

constexpr MarchOptions kMarch{0.5f, 1e-4f};

Camera CameraAt(const Vec3d& center, bool ndc) {
  Camera camera;
  camera.width = 24, camera.height = 18;
  camera.fx = camera.fy = 20;
  camera.cx = 12, camera.cy = 9;
  camera.camera_from_world.translation = center * -1.0;
  if (ndc) camera.ndc = {2 * 20.0 / 24, 2 * 20.0 / 18};
  return camera;
}

// Calls body(basis as a constant).
template <typename Body>
void ForBasis(int basis, const Body& body) {
  if (basis == 9) body(std::integral_constant<int, 9>());
  if (basis == 4) body(std::integral_constant<int, 4>());
  if (basis == 1) body(std::integral_constant<int, 1>());
}

double Apart(const Vec3f& a, const Vec3f& b) {
  double apart = 0;
  for (int c = 0; c < 3; ++c) apart = std::max(apart, std::abs(double{a[c]} - b[c]));
  return apart;
}

TEST(CellRay, FromRecordsItEqualsThePlainRay) {
  for (const int basis : {1, 4, 9})
    ForBasis(basis, [&](auto constant) {
      const RadianceField field = testing::RandomCellField({3, 2, 2}, 3, basis, 31);
      FastGrid grid = MakeFastGrid(field);
      std::vector<Ray> rays = testing::RandomRays(400, 32);
      rays[0].direction = {0, 0, 0};
      rays[1].origin.x = std::nanf("");
      for (const Ray& ray : rays) {
        const CellRaySums sums = RenderCellRay<constant.value, false>(
            HostView(&grid), ray, nullptr, 0, kMarch.stop_transmittance);
        const RayResult<float> plain = RenderRay(ViewOf(field), ray, kMarch);
        ASSERT_LE(Apart(sums.color, plain.color), 2e-5);
        ASSERT_NEAR(sums.transmittance, plain.transmittance, 2e-5);
        ASSERT_NEAR(sums.depth, plain.depth, 1e-4);
      }
    });
}

// The oracle: a field of degree 0 whose values are the vertices' colours.
TEST(CellRay, FromVertexColorsItIsAFieldOfDegree0) {
  for (const bool ndc : {false, true})
    for (const int basis : {1, 4, 9})
      ForBasis(basis, [&](auto constant) {
        const RadianceField field = testing::RandomCellField({3, 2, 2}, 3, basis, 33);
        FastGrid grid = MakeFastGrid(field);
        const DeviceGridView view = HostView(&grid);
        const Camera camera = CameraAt({0.1, -0.2, ndc ? 0.1 : -3.0}, ndc);
        const PinholeRays rays(camera);
        const std::vector<FourFloats> colors = ColorsOf<constant.value>(view, rays);
        const RadianceField flat = FieldSeenBy(field, camera);
        double seen = 0;
        for (int y = 0; y < rays.height; ++y)
          for (int x = 0; x < rays.width; ++x) {
            const Ray ray = rays.At(x, y);
            const CellRaySums sums = RenderCellRay<constant.value, true>(
                view, ray, colors.data(), 0, kMarch.stop_transmittance);
            const RayResult<float> plain = RenderRay(ViewOf(flat), ray, kMarch);
            ASSERT_LT(Apart(sums.color, plain.color), 2e-5) << x << " " << y;
            ASSERT_NEAR(sums.depth, plain.depth, 1e-4);
            seen += 1 - sums.transmittance;
          }
        EXPECT_GT(seen, 20);
      });
}

// All cells of one width, with coefficients that are linear in the position.
RadianceField LinearField(int cells) {
  const Vec3i size{cells, cells, cells};
  RadianceField field = testing::CellField(testing::TopCells(size, 0), size, 9, 41);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (int64_t v = 0; v < geometry->density.size(); ++v) {
    const Vec3i at = PlaceOf(geometry->cells.vertex_key[v]);
    geometry->density[v] = 1.5f;
    for (int k = 0; k < 27; ++k)
      field.appearance.sh[27 * v + k] = 0.3f * std::sin(static_cast<float>(k)) *
                                        static_cast<float>(at[k % 3] * 2 - cells) /
                                        static_cast<float>(cells);
  }
  field.geometry = geometry;
  return field;
}

double ErrorOfVertexColors(int cells, const Vec3d& center, float wide_angle) {
  const RadianceField field = LinearField(cells);
  FastGrid grid = MakeFastGrid(field);
  const DeviceGridView view = HostView(&grid);
  const PinholeRays rays(CameraAt(center, false));
  const std::vector<FourFloats> colors = ColorsOf<9>(view, rays);
  const Vec3f scale = grid.frame.Scale();
  const float wide_until =
      wide_angle > 0 ? 1 / (std::min({scale.x, scale.y, scale.z}) * wide_angle) : 0;
  double error = 0;
  for (int y = 0; y < rays.height; ++y)
    for (int x = 0; x < rays.width; ++x) {
      const Ray ray = rays.At(x, y);
      const float stop = kMarch.stop_transmittance;
      error = std::max(
          error, Apart(RenderCellRay<9, true>(view, ray, colors.data(), wide_until, stop).color,
                       RenderCellRay<9, false>(view, ray, nullptr, 0, stop).color));
    }
  return error;
}

// It falls with the square of the cells' width: by about four for each halving.
TEST(CellRay, TheErrorOfVertexColorsFallsWithTheSquareOfTheWidth) {
  const Vec3d before{0, 0, -4};
  const double at_8 = ErrorOfVertexColors(8, before, 0),
               at_16 = ErrorOfVertexColors(16, before, 0),
               at_32 = ErrorOfVertexColors(32, before, 0);
  EXPECT_GT(at_32, 1e-6);  // above rounding
  EXPECT_NEAR(at_8 / at_16, 4, 1);
  EXPECT_NEAR(at_16 / at_32, 4, 1);
}

// A camera in a cell sees its vertices all around.
TEST(CellRay, AWideCellTakesItsRecords) {
  const Vec3d within{0.1, -0.2, 0.05};
  EXPECT_GT(ErrorOfVertexColors(16, within, 0), 2e-3);
  EXPECT_LT(ErrorOfVertexColors(16, within, 1.0f / 8), 1e-3);
  EXPECT_LT(ErrorOfVertexColors(16, within, 1e-4f), 2e-6);  // all cells are wide
}

}  // namespace
}  // namespace regrade
