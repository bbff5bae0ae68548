// What a style adds voxel by voxel, as a page has it: rounded by half a step at most, nothing
// where nothing is added.
#include "pipeline/page/residual_codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "pipeline/files/deflate.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/value_codec.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

// Of every fifth voxel.
StyleLayers SomeLayers(size_t voxels) {
  StyleLayers layers;
  for (size_t i = 0; i < voxels; ++i) {
    const float x = i % 5 == 0 ? 0.3f * std::sin(static_cast<float>(i)) : 0;
    layers.residual.color.push_back({x, -x, 0.5f * x});
    layers.residual.view_scale.push_back({1, 1 - std::abs(x), 1 - 2 * std::abs(x)});
    layers.weight.push_back(std::abs(x));
  }
  return layers;
}

TEST(ResidualCodec, RoundedByHalfAStepAndZeroStaysZero) {
  const RadianceField field = testing::RandomField({16, 24, 16}, 9, 0.5, 5);
  const PageField page = EncodeField(field, 0.03);
  const PageRecords places = RecordsInPageOrder(page, *field.geometry);
  const size_t n = places.voxel.size();
  const StyleLayers layers = SomeLayers(n);
  const PageResidual packed = EncodeResidual(layers, places.earlier);
  for (size_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) {
      const float x = layers.residual.color[i][c], y = packed.rounded.residual.color[i][c];
      // The largest is 0.3; and float's own rounding.
      EXPECT_NEAR(x, y, 0.5 * 0.3 / 127 + 1e-6);
      EXPECT_NEAR(layers.residual.view_scale[i][c], packed.rounded.residual.view_scale[i][c],
                  0.5 / 255 + 1e-6);
      if (x != 0) continue;
      EXPECT_EQ(y, 0);
      EXPECT_EQ(packed.rounded.residual.view_scale[i][c], 1);
    }
  // The numbers of the section are those that were rounded to.
  const std::vector<int16_t> numbers =
      UnpackNumbers(Inflate(packed.packed, 14 * n, "residual"), 7, places.earlier);
  for (size_t i = 0; i < n; ++i) {
    EXPECT_EQ(packed.rounded.residual.view_scale[i].y,
              static_cast<float>(255 - numbers[4 * n + i]) / 255);
    EXPECT_EQ(packed.rounded.weight[i], static_cast<float>(numbers[6 * n + i]) / 255);
  }
}

TEST(ResidualCodec, NothingAddedCostsAlmostNothing) {
  const RadianceField field = testing::RandomField({32, 32, 32}, 1, 0.5, 5);
  const PageField page = EncodeField(field, 0.03);
  const PageRecords places = RecordsInPageOrder(page, *field.geometry);
  const size_t n = places.voxel.size();
  StyleLayers layers;
  layers.residual.color.resize(n);
  layers.weight.resize(n);
  // Zeros of 8 bytes a voxel; deflate's limit is 1 to 1032, and its header.
  EXPECT_LT(EncodeResidual(layers, places.earlier).packed.size(), 8 * n / 500 + 64);
}

TEST(ResidualCodec, WhatIsNotOfTheObjectStays) {
  RadianceField source = testing::RandomField({9, 8, 11}, 9, 0.6, 7);
  testing::AddSpheres(5, 12, 0.7, 8, &source);
  RadianceField styled = source;
  for (float& value : styled.appearance.sh) value = 0.25f - value;
  for (float& value : styled.appearance.sphere_color) value = 0.5f;
  styled.background = {0.1f, 0.2f, 0.3f};
  std::vector<int64_t> voxels;
  StyleLayers layers;
  for (int64_t v = 0; v < source.geometry->num_voxels(); ++v) {
    voxels.push_back(v);
    layers.weight.push_back(v % 3 == 0 ? 1.0f : 0.0f);
  }
  const RadianceField whole = styled;
  ApplyLayers(layers, voxels, source, &styled);
  const int stride = source.appearance.stride();
  for (int64_t i = 0; i < styled.appearance.sh.size(); ++i)
    EXPECT_EQ(styled.appearance.sh[i],
              i / stride % 3 == 0 ? whole.appearance.sh[i] : source.appearance.sh[i]);
  EXPECT_EQ(styled.background.x, source.background.x);
  for (int64_t i = 0; i < styled.appearance.sphere_color.size(); ++i)
    EXPECT_EQ(styled.appearance.sphere_color[i], source.appearance.sphere_color[i]);
}

// A density that is rounded to nothing keeps its voxel and its number.
TEST(ResidualCodec, VoxelsOfRoundedDensitiesKeepTheirNumbers) {
  RadianceField field = testing::RandomField({16, 16, 16}, 4, 0.7, 9);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  std::vector<int64_t> place(static_cast<size_t>(geometry->density.size()));  // of each voxel
  for (int64_t at = 0; at < geometry->links.size(); ++at) {
    const int32_t voxel = geometry->links[at];
    if (voxel < 0) continue;
    place[static_cast<size_t>(voxel)] = at;
    geometry->density[voxel] = at < geometry->frame.Vertex(8, 0, 0) ? 1e-9f : 1.0f;
  }
  field.geometry = geometry;
  const PageField page = EncodeField(field, 0.03);
  const RadianceField decoded = DecodeField(page);
  const PageRecords before = RecordsInPageOrder(page, *field.geometry);
  const PageRecords after = RecordsInPageOrder(page, *decoded.geometry);
  ASSERT_EQ(std::ssize(after.voxel), page.header.At("voxels").AsInt());
  ASSERT_EQ(before.voxel.size(), after.voxel.size());
  for (size_t i = 0; i < after.voxel.size(); ++i)
    EXPECT_EQ(decoded.geometry->links[place[static_cast<size_t>(before.voxel[i])]],
              after.voxel[i])
        << i;
}

}  // namespace
}  // namespace regrade
