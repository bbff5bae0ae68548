// The film's fast renderer against the exact one; skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "kernels/render/field_renderer.h"
#include "tests/support/device_test.h"
#include "tests/support/parity_row.h"
#include "tests/support/psnr.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

// A ball of smooth colours, with harmonics of all degrees up to 2 for a basis of 9, whose
// density falls to 0 over a width of `edge`: from an opaque surface to mist. The largest
// density is 6 / edge per world unit.
RadianceField Ball(float edge, int basis) {
  constexpr int n = 64;
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = {{n, n, n}, {0, 0, 0}, {1, 1, 1}};
  const int64_t count = geometry->frame.NumVertices();
  geometry->links.Resize(count);
  geometry->density.Resize(count);
  RadianceField field;
  field.appearance.basis = basis;
  field.appearance.sh.Resize(count * field.appearance.stride());
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z) {
        const int64_t v = geometry->frame.Vertex(x, y, z);
        geometry->links[v] = static_cast<int32_t>(v);
        const float p[3] = {2.0f * x / (n - 1) - 1, 2.0f * y / (n - 1) - 1,
                            2.0f * z / (n - 1) - 1};
        const float r = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        geometry->density[v] = 6 / edge * std::clamp((0.75f - r) / edge, 0.0f, 1.0f);
        for (int c = 0; c < 3; ++c)
          for (int k = 0; k < basis; ++k)
            field.appearance.sh[(v * 3 + c) * basis + k] =
                (k == 0 ? 1.0f : 0.1f) * std::sin(4 * p[c] + 2 * p[(c + k) % 3] + k);
      }
  field.geometry = std::move(geometry);
  field.background = {0.3f, 0.6f, 0.2f};
  return field;
}

Camera FilmCamera(bool inside) {
  Camera camera;
  camera.width = 160;
  camera.height = 120;
  camera.fx = camera.fy = 150;
  camera.cx = 80;
  camera.cy = 60;
  camera.camera_from_world.translation = {0.1, -0.05, inside ? 0.3 : 2.5};
  return camera;
}

using DeviceFilm = testing::DeviceTest;

// 55 dB is what the report promises, less than the rounding of an 8-bit picture changes it
// twice over (58.9 dB each).
TEST_F(DeviceFilm, FastFramesAreWithin55Db) {
  for (const bool layers : {false, true})
    for (const float edge : {0.1f, 0.3f, 0.7f}) {
      RadianceField field = Ball(edge, 9);
      if (layers) testing::AddSpheres(70, 12, 0.8, 43, &field);
      FieldRenderer renderer(field, Backend::kCuda);
      ASSERT_EQ(renderer.PrepareFast(), "");
      for (const bool inside : {false, true}) {
        const Camera camera = FilmCamera(inside);
        const Image exact = renderer.Render(camera).color;
        const double db =
            testing::Psnr(renderer.RenderFastWith(renderer, camera).other_color, exact);
        const auto [low, high] = std::minmax_element(exact.pixels.begin(), exact.pixels.end());
        ASSERT_GT(*high - *low, 0.2f);  // a picture of something
        // It is another renderer, not the exact one again.
        ASSERT_LT(db, 140) << edge;
        testing::ParityRow(layers ? "fast frame before layers" : "fast frame",
                           "edge " + std::to_string(edge) + (inside ? ", inside" : ""),
                           "the exact one, rms", std::pow(10, -db / 20),
                           std::pow(10, -55.0 / 20));
      }
    }
}

// The fast renderer has half precision for colours of degree 2 only; others stay exact.
TEST_F(DeviceFilm, ColoursOfALowerDegreeHaveNoFastRenderer) {
  for (const int basis : {1, 4}) {
    FieldRenderer renderer(Ball(0.3f, basis), Backend::kCuda);
    EXPECT_NE(renderer.PrepareFast().find("degree 2"), std::string::npos);
  }
}

TEST_F(DeviceFilm, PreparingChangesNoExactFrame) {
  const RadianceField field = Ball(0.3f, 9);
  FieldRenderer plain(field, Backend::kCuda), prepared(field, Backend::kCuda);
  ASSERT_EQ(prepared.PrepareFast(), "");
  prepared.RenderFastWith(prepared, FilmCamera(false));
  EXPECT_EQ(plain.Render(FilmCamera(false)).color.pixels,
            prepared.Render(FilmCamera(false)).color.pixels);
}

}  // namespace
}  // namespace regrade
