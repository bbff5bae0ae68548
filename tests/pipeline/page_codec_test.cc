// The codec of a page's field: what comes out renders as what went in; damage is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/field/render_ray.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/value_codec.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::RandomField;

constexpr double kStep = 0.03;  // regrade page's

std::vector<std::pair<const char*, RadianceField>> Fields() {
  std::vector<std::pair<const char*, RadianceField>> fields;
  for (const int basis : {1, 4, 9}) {
    fields.emplace_back("uniform", RandomField({13, 17, 9}, basis, 0.5, 6));
    fields.emplace_back("spheres", RandomField({9, 8, 11}, basis, 0.6, 7));
    testing::AddSpheres(5, 12, 0.7, 8, &fields.back().second);
  }
  return fields;
}

double Psnr(const RadianceField& a, const RadianceField& b) {
  double sum = 0;
  const std::vector<Ray> rays = testing::RandomRays(400, 3);
  for (const Ray& ray : rays) {
    const Vec3f d = RenderRay(ViewOf(a), ray, {}).color - RenderRay(ViewOf(b), ray, {}).color;
    sum += double{Dot(d, d)};
  }
  return -10 * std::log10(sum / 3 / static_cast<double>(rays.size()));
}

// Random values have the errors of rounding and no neighbours alike: the worst case for bytes,
// and for decibels, since a random coefficient is as large as a sample's colour; those that
// change with the view are kept within what `fit-view-bound` of the presets allows. Channels
// and harmonics that are not alike need the most bits: with 27 of them 128 do not suffice for
// the 48 dB that scenes have.
TEST(PageCodec, DecodedFieldRendersAsTheExactOne) {
  for (auto& [name, field] : Fields()) {
    const int basis = field.appearance.basis;
    for (int64_t i = 0; i < field.appearance.sh.size(); ++i)
      if (i % basis != 0)
        field.appearance.sh[i] = std::clamp(field.appearance.sh[i], -0.2f, 0.2f);
    const double db = Psnr(field, DecodeField(EncodeField(field, kStep)));
    EXPECT_GE(db, basis == 9 ? 46 : 48) << name << " " << basis;
  }
}

TEST(PageCodec, WhatNoRayCanSeeIsLeftOut) {
  RadianceField field = RandomField({16, 16, 16}, 4, 0.7, 9);
  const size_t all = EncodeField(field, kStep).bytes();
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (int64_t at = 0; at < geometry->frame.Vertex(8, 0, 0); ++at)
    if (geometry->links[at] >= 0) geometry->density[geometry->links[at]] = -1;
  field.geometry = geometry;
  const PageField page = EncodeField(field, kStep);
  EXPECT_LT(static_cast<double>(page.bytes()), 0.8 * static_cast<double>(all));
  EXPECT_LT(page.header.At("voxels").AsInt(), field.geometry->num_voxels());
  EXPECT_GE(Psnr(field, DecodeField(page)), 48);
}

// A second page of the decoded field has its voxels, and no second loss of a first one's size.
TEST(PageCodec, CopyOfACopyHasTheSamePlaces) {
  for (const auto& [name, field] : Fields()) {
    const PageField first = EncodeField(field, kStep);
    const PageField second = EncodeField(DecodeField(first), kStep);
    EXPECT_EQ(first.sections[0].packed, second.sections[0].packed) << name;
    EXPECT_EQ(first.header.At("voxels").AsInt(), second.header.At("voxels").AsInt());
  }
}

TEST(PageCodec, EqualFieldsGiveEqualBytes) {
  const RadianceField field = RandomField({8, 8, 8}, 9, 0.7, 11);
  const PageField a = EncodeField(field, kStep), b = EncodeField(field, kStep);
  EXPECT_EQ(DumpJson(a.header), DumpJson(b.header));
  ASSERT_EQ(a.sections.size(), b.sections.size());
  for (size_t i = 0; i < a.sections.size(); ++i)
    EXPECT_EQ(a.sections[i].packed, b.sections[i].packed);
}

// Changed bytes of sections are the fuzz target's page_field.
TEST(PageCodec, DamagedSectionsAreRefused) {
  for (const auto& [name, field] : Fields()) {
    if (field.appearance.basis != 4) continue;
    const PageField page = EncodeField(field, 0.1);
    for (size_t s = 0; s < page.sections.size(); ++s) {
      PageField cut = page;
      cut.sections[s].packed.pop_back();
      EXPECT_REGRADE_ERROR(DecodeField(cut), ExitCode::kInput, "damaged");
      PageField missing = page;
      missing.sections.erase(missing.sections.begin() + static_cast<std::ptrdiff_t>(s));
      EXPECT_REGRADE_ERROR(DecodeField(missing), ExitCode::kInput, "is missing");
    }
  }
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

// EQ(page-density): the error of an optical depth is at most half a step of its square root,
// |d(q^2)| tau <= (q + 1/4) tau.
TEST(PageCodec, DensityIsRoundedInTheSquareRoot) {
  for (const double width : {0.01, 1.0, 8.0})
    for (double depth = 1e-5; depth < 50; depth *= 1.07) {
      const int16_t number = DensityNumber(depth / width, width);
      const double error = std::abs(DensityOfNumber(number, width) * width - depth);
      EXPECT_LE(error,
                (std::sqrt(depth / kPageOpticalDepth) + 0.25) * kPageOpticalDepth * 1.001);
      EXPECT_EQ(DensityNumber(-depth / width, width), -number);
    }
}

}  // namespace
}  // namespace regrade
