// What a style adds splat by splat, as a page has it: rounded by half a step at most, nothing
// where nothing is added.
#include "pipeline/page/residual_codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/splats/splat_field.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/splat_numbers.h"
#include "pipeline/page/value_codec.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

// Of every fifth splat.
StyleLayers SomeLayers(size_t splats) {
  StyleLayers layers;
  for (size_t i = 0; i < splats; ++i) {
    const float x = i % 5 == 0 ? 0.3f * std::sin(static_cast<float>(i)) : 0;
    layers.residual.color.push_back({x, -x, 0.5f * x});
    layers.residual.view_scale.push_back({1, 1 - std::abs(x), 1 - 2 * std::abs(x)});
    layers.weight.push_back(std::abs(x));
  }
  return layers;
}

TEST(ResidualCodec, RoundedByHalfAStepAndZeroStaysZero) {
  constexpr size_t n = 3000;
  const std::vector<EarlierRecords> earlier = EarlierSplats(n, n / 6);
  const StyleLayers layers = SomeLayers(n);
  const PageResidual packed = EncodeResidual(layers, earlier);
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
      UnpackNumbers(Inflate(packed.packed, 14 * n, "residual"), 7, earlier);
  for (size_t i = 0; i < n; ++i) {
    EXPECT_EQ(packed.rounded.residual.view_scale[i].y,
              static_cast<float>(255 - numbers[4 * n + i]) / 255);
    EXPECT_EQ(packed.rounded.weight[i], static_cast<float>(numbers[6 * n + i]) / 255);
  }
}

TEST(ResidualCodec, NothingAddedCostsAlmostNothing) {
  constexpr size_t n = 16000;
  const std::vector<EarlierRecords> earlier = EarlierSplats(n, n / 6);
  StyleLayers layers;
  layers.residual.color.resize(n);
  layers.weight.resize(n);
  // Zeros of 8 bytes a splat; deflate's limit is 1 to 1032, and its header.
  EXPECT_LT(EncodeResidual(layers, earlier).packed.size(), 8 * n / 500 + 64);
}

TEST(ResidualCodec, WhatIsNotOfTheObjectStays) {
  const RadianceField source = FieldOfSplats(
      testing::CastSplats<float>(testing::RandomSplats(200, 9, 5, 1.3, 0.02)), {}, 0.1f, -1);
  RadianceField styled = source;
  for (float& value : styled.appearance.sh) value = 0.25f - value;
  styled.background = {0.1f, 0.2f, 0.3f};
  std::vector<int64_t> splats;
  StyleLayers layers;
  for (int64_t v = 0; v < source.geometry->num_voxels(); ++v) {
    splats.push_back(v);
    layers.weight.push_back(v % 3 == 0 ? 1.0f : 0.0f);
  }
  const RadianceField whole = styled;
  ApplyLayers(layers, splats, source, &styled);
  const int stride = source.appearance.stride();
  for (int64_t i = 0; i < styled.appearance.sh.size(); ++i)
    EXPECT_EQ(styled.appearance.sh[i],
              i / stride % 3 == 0 ? whole.appearance.sh[i] : source.appearance.sh[i]);
  EXPECT_EQ(styled.background.x, source.background.x);
}

}  // namespace
}  // namespace regrade
