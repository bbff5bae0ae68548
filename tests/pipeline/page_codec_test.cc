// The codec of a page's field: what comes out renders as what went in; damage is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "kernels/field/pad_sh_basis.h"
#include "kernels/image/decibels.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/cpu/seen_by_cameras.h"
#include "kernels/splats/extent.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/most_shown.h"
#include "pipeline/page/splat_numbers.h"
#include "pipeline/page/style_codec.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

RadianceField FieldOf(int64_t count, int basis, bool antialiased = false) {
  const GridFrame box{{}, {0.1f, 0, -0.2f}, {0.8f, 1, 0.7f}};
  Splats splats = testing::CastSplats<float>(testing::RandomSplats(count, basis, 3, 1.4, 0.03));
  for (size_t i = 0; i < splats.sh.size(); ++i)
    if (i % static_cast<size_t>(basis) != 0) splats.sh[i] *= 0.4f;
  return FieldOfSplats(splats, box, 0.1f, antialiased ? 0.0f : -1.0f);
}

Image Picture(const RadianceField& field) {
  return FieldRenderer(field, Backend::kCpu).Render(testing::SplatCameraOf(64, 48)).color;
}

TEST(PageCodec, DecodedSplatsRenderAsTheExactOnes) {
  for (const int basis : {1, 4, 9})
    for (const bool antialiased : {false, true}) {
      const RadianceField field = FieldOf(800, basis, antialiased);
      const RadianceField decoded = DecodeField(EncodeField(field));
      EXPECT_EQ(decoded.geometry->splats.fit_pixel, field.geometry->splats.fit_pixel);
      EXPECT_GE(DecibelsBetween(Picture(field), Picture(decoded)), 48) << basis;
    }
}

// A second page of the decoded field has no second loss of a first one's size.
TEST(PageCodec, ACopyOfACopyIsTheCopy) {
  const RadianceField field = FieldOf(300, 4);
  const PageField first = EncodeField(field);
  const RadianceField copy = DecodeField(first);
  const PageField second = EncodeField(copy);
  EXPECT_EQ(first.sections[0].packed, second.sections[0].packed);
  EXPECT_EQ(first.count(), second.count());
  EXPECT_GE(DecibelsBetween(Picture(field), Picture(DecodeField(second))), 45);
}

TEST(PageCodec, EqualFieldsGiveEqualBytes) {
  const PageField a = EncodeField(FieldOf(300, 9)), b = EncodeField(FieldOf(300, 9));
  EXPECT_EQ(DumpJson(a.header), DumpJson(b.header));
  ASSERT_EQ(a.sections.size(), b.sections.size());
  for (size_t i = 0; i < a.sections.size(); ++i)
    EXPECT_EQ(a.sections[i].packed, b.sections[i].packed);
}

// EQ(page-prediction): numbers come back to the bit, negative ones and the largest, too.
TEST(PageCodec, NumbersComeBack) {
  std::vector<EarlierRecords> earlier;
  std::vector<int16_t> number;
  for (int32_t i = 0; i < 200; ++i) {
    earlier.push_back({i > 0 ? i - 1 : -1, i > 4 ? i - 5 : -1, i > 30 ? i - 31 : -1});
    number.push_back(static_cast<int16_t>(i % 3 == 0   ? kMaxNumber
                                          : i % 3 == 1 ? -kMaxNumber
                                                       : i - 90));
  }
  EXPECT_EQ(UnpackNumbers(PackNumbers(number, 1, earlier), 1, earlier), number);
}

// A page has harmonics of degree 2 at most.
TEST(PageCodec, HigherHarmonicsAreLeftOut) {
  const RadianceField field = FieldOf(800, 16);
  const RadianceField decoded = DecodeField(EncodeField(field));
  EXPECT_EQ(decoded.appearance.basis, 9);
  RadianceField lower = field;
  lower.appearance = LimitShBasis(field.appearance, 9);
  EXPECT_GE(DecibelsBetween(Picture(lower), Picture(decoded)), 47);
}

// Its style is that of the colours without them.
TEST(PageCodec, AStyleOfDegreeThreeIsAppliedToThePagesHarmonics) {
  StoredNetwork stored{testing::RandomNetwork(7, 1.1, 16), 1, {}};
  stored.network.data().has_base = true;
  stored.network.data().base = testing::SomeMap();
  RadianceField page = DecodeField(EncodeField(FieldOf(200, 16)));
  const PageStyle style = EncodeStyle(stored, page, 1);
  EXPECT_EQ(style.header.At("bound").AsDouble(), stored.network.Bound());
  RadianceField padded = page;
  padded.appearance = PadShBasis(std::move(padded.appearance), 16);
  const Appearance all = ApplyNetwork(stored.network, padded);
  page.appearance.sh = Buffer<float>(page.appearance.sh.size());
  for (int64_t i = 0; i < page.appearance.sh.size(); ++i)
    page.appearance.sh[i] = all.sh[i / 9 * 16 + i % 9];
  page.background = stored.background;
  EXPECT_GE(DecibelsBetween(Picture(page), Picture(style.styled)), 40);
}

// EQ(page-splat): half a step of each number at most, for splats far outside, too.
TEST(PageCodec, NumbersAreRoundedByHalfAStep) {
  const GridFrame box{{}, {0.1f, 0, -0.2f}, {0.8f, 1, 0.7f}};
  for (uint64_t i = 0; i < 400; ++i) {
    Splat<float> splat;
    const double far = std::exp(testing::Draw(1, i, 0, -2, 5));
    double farthest = 1;
    for (int a = 0; a < 3; ++a) {
      const auto part = static_cast<uint64_t>(a);
      splat.mean[a] = static_cast<float>(testing::Draw(1, i, 1 + part, -far, far));
      splat.log_scale[a] = static_cast<float>(testing::Draw(1, i, 4 + part, -9, 2));
      farthest = std::max(
          farthest, std::abs(double{splat.mean[a] - box.center[a]} / double{box.radius[a]}));
    }
    for (uint64_t a = 0; a < 4; ++a)
      splat.quaternion[a] = static_cast<float>(testing::Draw(1, i, 7 + a, -1, 1));
    splat.opacity_logit = static_cast<float>(testing::Draw(1, i, 11, -4, 4));
    const Splat<float> got = SplatOfNumbers(NumbersOfSplat(splat, box), box);
    // The contraction's slope is 1 / m across and 1 / m^2 along the way from the box.
    const double reach = 0.5 * kPositionStep * farthest * farthest * 3;
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(got.mean[a], splat.mean[a],
                  (farthest > 1 ? reach : 0.5 * kPositionStep) + 1e-6);
      EXPECT_NEAR(got.log_scale[a], splat.log_scale[a], 0.5 * kLogScaleStep + 1e-5);
    }
    // Half turns change columns' signs. A component's error is half a step, that of w up to
    // sqrt(3) times as large; an entry has derivatives of at most 4 by each.
    const Mat3f want = RotationOf(splat.quaternion), rotation = RotationOf(got.quaternion);
    for (int k = 0; k < 3; ++k) {
      float along = 0;
      for (int r = 0; r < 3; ++r) along += want(r, k) * rotation(r, k);
      EXPECT_GT(std::abs(along), 1 - 1e-4);
      for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(rotation(r, k) * (along < 0 ? -1 : 1), want(r, k), 6 * kRotationStep);
    }
    const double opacity = std::exp(LogSigmoid(double{splat.opacity_logit}));
    EXPECT_NEAR(std::exp(LogSigmoid(double{got.opacity_logit})), std::min(opacity, 255.0 / 256),
                0.5 / kOpacitySteps + 1e-6);
  }
}

TEST(PageCodec, FirstComeThoseThatContributeMost) {
  RadianceField field = FieldOf(600, 1);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (int64_t i = 0; i < 3; ++i) {  // the largest three, in the middle of the box
    for (int a = 0; a < 3; ++a)
      geometry->splats.mean[3 * i + a] = 0, geometry->splats.log_scale[3 * i + a] = 0;
    geometry->splats.opacity_logit[i] = 3;
  }
  geometry->splats.opacity_logit[3] = -6;  // nothing of it is seen
  field.geometry = geometry;
  const SplatOrder order = OrderOfSplats(*geometry);
  EXPECT_EQ(std::ssize(order.splat), 599);
  EXPECT_EQ(std::ranges::count(order.splat, 3), 0);
  const auto coarse_end = order.splat.begin() + order.coarse;
  for (int64_t i = 0; i < 3; ++i)
    EXPECT_EQ(std::count(order.splat.begin(), coarse_end, i), 1) << i;
}

// What a style adds splat by splat needs the same order from both fields.
TEST(PageCodec, OrderIsThatOfTheDecodedField) {
  const RadianceField field = FieldOf(500, 4);
  const PageField page = EncodeField(field);
  const RadianceField decoded = DecodeField(page);
  const PageRecords of = RecordsInPageOrder(page, *field.geometry),
                    own = RecordsInPageOrder(page, *decoded.geometry);
  EXPECT_EQ(of.earlier, own.earlier);
  std::vector<int64_t> all(own.splat.size());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(own.splat, all);
  for (const int64_t i : all)
    for (int a = 0; a < 3; ++a)
      EXPECT_NEAR(decoded.geometry->splats.mean[3 * i + a],
                  field.geometry->splats.mean[3 * of.splat[static_cast<size_t>(i)] + a], 1e-3);
}

TEST(ByWhatIsShown, FirstComesWhatPicturesNeed) {
  const RadianceField field = FieldOf(300, 1);
  Camera camera = testing::SplatCameraOf(40, 30);
  camera.fx *= 6, camera.fy *= 6;
  const std::vector<uint8_t> seen =
      SeenSplats(SplatsOf(field), {camera}, SplatOptionsOf(field));
  const auto count = std::ranges::count(seen, 1);
  ASSERT_GT(count, 20);
  ASSERT_LT(count, 290);
  std::vector<int64_t> order = ByWhatIsShown(field, {camera});
  for (int64_t i = 0; i < count / 2; ++i)
    EXPECT_EQ(seen[static_cast<size_t>(order[static_cast<size_t>(i)])], 1);
  const FieldRenderer whole(field, Backend::kCpu);
  const auto error = [&](int64_t first, int64_t last) {
    Splats part(0, 1);
    part.background = field.background;
    std::vector<uint8_t> in(300);
    for (int64_t i = first; i < last; ++i)
      in[static_cast<size_t>(order[static_cast<size_t>(i)])] = 1;
    AppendSplats(
        SplatsOf(field), [&](int64_t i) { return in[static_cast<size_t>(i)] != 0; }, &part);
    const RadianceField of_part =
        FieldOfSplats(part, field.geometry->frame, field.near_clip, -1);
    return -DecibelsBetween(FieldRenderer(of_part, Backend::kCpu).Render(camera).color,
                            whole.Render(camera).color);
  };
  EXPECT_LT(error(0, count / 2), error(count / 2, count));
  std::ranges::sort(order);
  for (int64_t i = 0; i < 300; ++i) EXPECT_EQ(order[static_cast<size_t>(i)], i);
}

TEST(PageCodec, DamagedSectionsAreRefused) {
  const PageField page = EncodeField(FieldOf(60, 4));
  ASSERT_EQ(page.sections.size(), 4u);
  for (size_t s = 0; s < page.sections.size(); ++s) {
    PageField cut = page, missing = page;
    cut.sections[s].packed.pop_back();
    EXPECT_REGRADE_ERROR(DecodeField(cut), ExitCode::kInput, "damaged");
    missing.sections.erase(missing.sections.begin() + static_cast<std::ptrdiff_t>(s));
    EXPECT_REGRADE_ERROR(DecodeField(missing), ExitCode::kInput, "is missing");
  }
}

TEST(PageCodec, MoreSplatsThanThePageHasAreRefused) {
  PageField page = EncodeField(FieldOf(60, 1));
  page.header["splats"]["count"] = 50'000'000;
  EXPECT_REGRADE_ERROR(DecodeField(page), ExitCode::kInput, "fewer splats");
}

}  // namespace
}  // namespace regrade
