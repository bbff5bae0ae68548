// Mixing styles: exact ends, linear between them, nothing beyond them.
#include "stylize/field/blend_fields.h"

#include <algorithm>
#include <cstring>

#include "kernels/field/pad_sh_basis.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

struct Styles {
  RadianceField source = Ball(14), day, night;
  Styles() {
    for (int64_t i = 0; i < source.appearance.sh.size(); ++i)
      source.appearance.sh[i] *= 0.3f;  // no clamps
    day = night = source;
    ColorMap map;
    map.matrix.row[0] = {0.8, 0.1, 0.0};
    map.offset = {0.05, 0.05, 0.1};
    day.appearance = ApplyColorMap(source.appearance, map);
    day.background = {0.9f, 0.8f, 0.7f};
    map.matrix.row[2] = {0.1, 0.2, 0.6};
    map.offset = {0.1, 0.05, 0.15};
    night.appearance = ApplyColorMap(source.appearance, map);
    night.background = {0.05f, 0.05f, 0.2f};
  }
};

bool SameBits(const RadianceField& a, const RadianceField& b) {
  return std::memcmp(a.appearance.sh.data(), b.appearance.sh.data(),
                     static_cast<size_t>(a.appearance.sh.size()) * sizeof(float)) == 0 &&
         std::memcmp(&a.background, &b.background, sizeof a.background) == 0;
}

TEST(MixFields, H49_TheEndsAreTheFieldsThemselves) {
  const Styles s;
  EXPECT_TRUE(SameBits(MixFields(s.source, {&s.day, &s.night}, {0, 0}), s.source));
  EXPECT_TRUE(testing::RecordSameBits(
      "the end of a mix", testing::Computed::kFloat,
      SameBits(MixFields(s.source, {&s.day, &s.night}, {1, 0}), s.day)));
  EXPECT_TRUE(SameBits(MixFields(s.source, {&s.day, &s.night}, {0, 1}), s.night));
  EXPECT_FALSE(SameBits(MixFields(s.source, {&s.day}, {0.5}), s.day));
  EXPECT_EQ(MixFields(s.source, {&s.day}, {0.5}).geometry, s.source.geometry);
}

TEST(MixFields, WhereNothingIsClampedTheRendersMixToo) {
  const Styles s;
  const std::vector<Ray> rays = SomeRays(3, 20).rays;
  const std::vector<Vec3f> before = Render(s.source, rays), day = Render(s.day, rays),
                           night = Render(s.night, rays);
  const std::vector<Vec3f> mixed =
      Render(MixFields(s.source, {&s.day, &s.night}, {0.5, 0.3}), rays);
  double farthest = 0;
  for (size_t r = 0; r < rays.size(); ++r) {
    const Vec3f expected = before[r] * 0.2f + day[r] * 0.5f + night[r] * 0.3f;
    farthest = std::max<double>(farthest, Norm(mixed[r] - expected));
    EXPECT_LE(Norm(mixed[r] - expected),
              testing::RecordBound("a mixed render", testing::Computed::kFloat,
                                   Norm(mixed[r] - expected),
                                   2e-6));  // float sums of some fifty samples
  }
  EXPECT_GT(farthest, 0);  // another order of sums, not the same field
}

TEST(MixFields, H49_TheMixIsNoSteeperThanItsParts) {
  // Of two networks, as maps of one field's coefficients.
  const RadianceField field = Ball(10);
  const LipschitzNetwork one = RandomNetwork(11), other = RandomNetwork(12);
  RadianceField a = field, b = field;
  a.appearance = ApplyNetwork(one, field);
  b.appearance = ApplyNetwork(other, field);
  const double limit = 0.3 * one.Bound() + 0.7 * other.Bound();
  const RadianceField mixed = MixFields(field, {&a, &b}, {0.3, 0.7});
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  const int64_t n = field.geometry->num_voxels();
  double steepest = 0;
  for (int64_t i = 0; i < 4000; ++i) {
    const int64_t v = i * 7919 % n, w = i * 104729 % n;
    float x[kFeatureStride], y[kFeatureStride];
    FillFeatures(field, 1, v, vertex[static_cast<size_t>(v)], x);
    FillFeatures(field, 1, w, vertex[static_cast<size_t>(w)], y);
    double apart = 0, changed = 0;
    for (int k = 0; k < kNetworkInputs; ++k) apart += (x[k] - y[k]) * (x[k] - y[k]);
    for (int k = 0; k < 27; ++k) {
      const double d = mixed.appearance.sh[v * 27 + k] - mixed.appearance.sh[w * 27 + k];
      changed += d * d;
    }
    if (apart > 1e-6) steepest = std::max(steepest, std::sqrt(changed / apart));
  }
  EXPECT_GT(steepest, 0);
  EXPECT_LE(steepest,
            limit * testing::RecordBound("a mix's steepest pair over its bound",
                                         testing::Computed::kFloat, steepest / limit, 1));
  EXPECT_LE(limit, std::max(one.Bound(), other.Bound()));
}

TEST(MixFields, H49_WhatIsBeyondTheEndsIsRefused) {
  const testing::MayBeNotFinite allowed;
  const Styles s;
  for (const std::vector<double>& weights :
       {std::vector<double>{1.1, 0}, {-0.1, 0.5}, {0.6, 0.6}, {std::nan(""), 0}})
    EXPECT_REGRADE_ERROR(MixFields(s.source, {&s.day, &s.night}, weights), ExitCode::kUsage,
                         "--mix");
  const RadianceField other = Ball(15);
  EXPECT_REGRADE_ERROR(MixFields(s.source, {&s.day, &other}, {0.5, 0.5}), ExitCode::kInput,
                       "style 2");
}

TEST(MixFields, ASourceWithFewerHarmonicsCountsAsPadded) {
  const Styles s;
  RadianceField fewer = s.source, padded = s.source;
  fewer.appearance = LimitShBasis(s.source.appearance, 4);
  padded.appearance = PadShBasis(fewer.appearance, s.day.appearance.basis);
  const RadianceField is = MixFields(fewer, {&s.day}, {0.3}),
                      should = MixFields(padded, {&s.day}, {0.3});
  ASSERT_EQ(is.appearance.basis, s.day.appearance.basis);
  for (int64_t i = 0; i < should.appearance.sh.size(); ++i)
    ASSERT_EQ(is.appearance.sh[i], should.appearance.sh[i]);
}

// Colours on background spheres are mixed as voxels are, and stay where only an object is
// styled.
TEST(MixFields, SurroundingsAreMixedToo) {
  Styles s;
  for (auto [field, value] : {std::pair{&s.source, 0.2f}, {&s.day, 0.8f}, {&s.night, 0.1f}}) {
    field->appearance.sphere_color.Resize(6);
    for (float& x : field->appearance.sphere_color) x = value;
  }
  const RadianceField mixed = MixFields(s.source, {&s.day, &s.night}, {0.5, 0.25});
  for (const float x : mixed.appearance.sphere_color)
    EXPECT_NEAR(x, 0.25 * 0.2 + 0.5 * 0.8 + 0.25 * 0.1, 1e-7);
  EXPECT_EQ(MixFields(s.source, {&s.day}, {1}).appearance.sphere_color[5], 0.8f);
  const std::vector<float> weights(static_cast<size_t>(s.source.geometry->num_voxels()), 1.0f);
  EXPECT_EQ(MixFields(s.source, {&s.day}, {1}, &weights).appearance.sphere_color[0], 0.2f);
}

TEST(MixFields, H50_SharesKeepWhatIsNotTheirs) {
  const Styles s;
  const int64_t n = s.source.geometry->num_voxels();
  std::vector<float> weights(static_cast<size_t>(n), 0.0f);
  for (int64_t v = 0; v < n; v += 2) weights[static_cast<size_t>(v)] = v % 4 == 0 ? 1.0f : 0.5f;
  const RadianceField mixed = MixFields(s.source, {&s.day}, {1}, &weights);
  EXPECT_EQ(std::memcmp(&mixed.background, &s.source.background, sizeof mixed.background), 0);
  for (int64_t v = 0; v < n; ++v)
    for (int k = 0; k < 27; ++k) {
      const float before = s.source.appearance.sh[v * 27 + k],
                  after = s.day.appearance.sh[v * 27 + k],
                  here = mixed.appearance.sh[v * 27 + k];
      if (v % 2 == 1)
        ASSERT_EQ(here, before);
      else if (v % 4 == 0)
        ASSERT_EQ(here, after);
      else
        ASSERT_NEAR(here, 0.5f * (before + after), 1e-6);
    }
}

}  // namespace
}  // namespace regrade
