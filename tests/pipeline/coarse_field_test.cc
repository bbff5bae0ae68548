// The coarse field of a page: the same box, fewer voxels, about the same light.
#include "pipeline/page/coarse_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "kernels/field/render_ray.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

// Optical depth times length: what all rays together lose, in the field's frame.
double Matter(const RadianceField& field) {
  const Geometry& geometry = *field.geometry;
  const Vec3f scale = geometry.frame.Scale();
  const double voxel = 1 / (double{scale.x} * double{scale.y} * double{scale.z});
  double sum = 0;
  for (int64_t v = 0; v < geometry.num_voxels(); ++v)
    sum += std::max(0.0, double{geometry.density[v]}) * voxel;
  return sum;
}

TEST(CoarseField, HasTheBoxAndTheMatterOfTheField) {
  for (RadianceField field : {testing::RandomField({16, 24, 16}, 9, 0.5, 5),
                              testing::RandomField({13, 17, 9}, 4, 0.5, 6)}) {
    field.near_clip = 0.25f;
    const auto coarse = CoarseField(field, {.most_part = 10});
    ASSERT_TRUE(coarse.has_value());
    EXPECT_NO_THROW(Validate(*coarse, "coarse"));
    EXPECT_EQ(coarse->near_clip, 0.25f);
    EXPECT_LT(coarse->geometry->num_voxels(), field.geometry->num_voxels());
    const GridFrame &fine = field.geometry->frame, &wide = coarse->geometry->frame;
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(wide.center[a] - wide.radius[a], fine.center[a] - fine.radius[a], 1e-5);
      EXPECT_GE(wide.center[a] + wide.radius[a], fine.center[a] + fine.radius[a] - 1e-5);
    }
    // Sums are in float, and voxels that are all but empty are left out.
    EXPECT_NEAR(Matter(*coarse) / Matter(field), 1, 0.05);
  }
}

// A wall of one colour looks like it from afar, through the coarse field as well.
TEST(CoarseField, AWallStaysOpaqueAndKeepsItsColour) {
  RadianceField field = testing::RandomField({32, 32, 32}, 1, 1, 6);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (int x = 0; x < 32; ++x)
    for (int y = 0; y < 32; ++y)
      for (int z = 0; z < 32; ++z) {
        const int64_t v = geometry->links[geometry->frame.Vertex(x, y, z)];
        if (v < 0) continue;
        geometry->density[v] = x >= 14 && x < 18 ? 40.0f : 0.0f;
        for (int c = 0; c < 3; ++c)
          field.appearance.sh[3 * v + c] = 0.5f * static_cast<float>(c);
      }
  field.geometry = geometry;
  const auto coarse = CoarseField(field, {.most_part = 10});
  ASSERT_TRUE(coarse.has_value());
  const Vec3f center = geometry->frame.center;
  const float far = 3 * geometry->frame.radius.x;
  const Ray ray{{center.x - far, center.y + 0.1f, center.z - 0.1f}, {1, 0, 0}};
  const auto exact = RenderRay(ViewOf(field), ray, {}),
             seen = RenderRay(ViewOf(*coarse), ray, {});
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen.color[c], exact.color[c], 0.02);
}

TEST(CoarseField, SmallFieldsHaveNone) {
  const RadianceField field = testing::RandomField({16, 24, 16}, 9, 0.5, 5);
  EXPECT_FALSE(CoarseField(field, {.most_part = 0.001}).has_value());
  EXPECT_FALSE(CoarseField(field, {.most_voxels = 0}).has_value());
}

}  // namespace
}  // namespace regrade
