#include "pipeline/images/cube_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "pipeline/files/atomic_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

ColorLut Parse(const std::string& text) { return ParseCube(text, "look.cube"); }

const std::string kCorners = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n";

TEST(CubeFile, AWrittenTableComesBack) {
  const ColorTable table = TabulateColors(17, [](const Vec3d& c) {
    return Vec3d{c.x * c.x, 0.2 + 0.5 * c.y, 0.5 * (c.z + c.x)};
  });
  const ColorLut lut = Parse(CubeText(table, "a look"));
  EXPECT_EQ(lut.title, "a look");
  ASSERT_EQ(lut.table.size, 17);
  for (size_t i = 0; i < table.values.size(); ++i)
    for (int c = 0; c < 3; ++c)  // six decimals
      ASSERT_NEAR(lut.table.values[i][c], table.values[i][c], 6e-7);
  EXPECT_NEAR(lut.Slope(), SteepestSlope(table), 1e-4);
}

TEST(CubeFile, RedVariesFastestAndTheDomainCounts) {
  const ColorLut lut = Parse("LUT_3D_SIZE 2\nDOMAIN_MIN 0 0 0\nDOMAIN_MAX 2 1 1\n" + kCorners);
  EXPECT_EQ(lut({2, 0, 0}), (Vec3d{1, 0, 0}));
  EXPECT_EQ(lut({1, 0, 1}), (Vec3d{0.5, 0, 1}));
  EXPECT_EQ(Parse("LUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE 0 2\n" + kCorners)({1, 1, 1}),
            (Vec3d{0.5, 0.5, 0.5}));
}

TEST(CubeFile, CurvesCommentsTitlesAndLineEnds) {
  const ColorLut lut = Parse(
      "\xef\xbb\xbf# made by hand\r\n\r\nTITLE \"two words\"\r\nLUT_1D_SIZE 3\r\n"
      "0 0 0 # black\r\n0.25 0.5 0.75\r\n1 1 1\r\n");
  EXPECT_EQ(lut.title, "two words");
  EXPECT_EQ(lut({0.5, 0.5, 0.5}), (Vec3d{0.25, 0.5, 0.75}));
  EXPECT_EQ(lut({0.75, 0, 7}), (Vec3d{0.625, 0, 1}));
  EXPECT_NEAR(lut.Slope(), 1.5, 1e-12);
}

TEST(CubeFile, NumbersAreThoseOfAnyProgram) {
  const ColorLut lut = Parse(
      "\xef\xbb\xbfLUT_1D_SIZE\t+2\t\r\nDOMAIN_MIN +0 -0 0.\r\n"
      "+0.5\t.25 +2.5E-01 \t\r\n+1.0e+00 1. 1E0\t\r\n");
  ASSERT_EQ(lut.curves.values.size(), 2u);
  EXPECT_EQ(lut({0, 0, 0}), (Vec3d{0.5, 0.25, 0.25}));
  EXPECT_EQ(lut({1, 1, 1}), (Vec3d{1, 1, 1}));
  for (const char* word : {"++1", "+-1", "-+1", "+", "0x1", "1,5", "1e", "inf"})
    EXPECT_REGRADE_ERROR(Parse(std::string("LUT_1D_SIZE 2\n0 0 0\n1 ") + word + " 1\n"),
                         ExitCode::kInput, "line 3");
}

TEST(CubeFile, HowSteepALutIsIsSaid) {
  const auto ramp = [](double slope) {
    return Parse("LUT_1D_SIZE 2\n0 0 0\n" + Format("%g 1 1\n", slope));
  };
  EXPECT_NE(SlopeText(ramp(kHarmlessSlope)).find("8.00 times, which is harmless"),
            std::string::npos);
  EXPECT_NE(SlopeText(ramp(61.7)).find("61.70 times, more than 8"), std::string::npos);
}

TEST(CubeFile, F94_DamagedFilesAreRefusedWithTheirLine) {
  const struct {
    const char* text;
    const char* says;
  } kCases[] = {
      {"", "has no LUT_3D_SIZE"},
      {"LUT_3D_SIZE 2\n0 0 0\n", "has 1 colours, and its size asks for 8"},
      {"LUT_3D_SIZE 130\n", "line 1 has the size '130', not one from 2 to 129"},
      {"LUT_3D_SIZE 1\n", "line 1 has the size '1'"},
      {"LUT_3D_SIZE 99999999999999999999\n", "line 1 has the size"},
      {"LUT_1D_SIZE 65537\n", "2 to 65536"},
      {"LUT_1D_SIZE 2\nLUT_3D_SIZE 2\n", "line 2 has a second size"},
      {"0 0 0\nLUT_1D_SIZE 2\n", "line 1 has a colour or something unknown before"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 nan 1\n", "line 3 has the number nan, beyond"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 1e9 1\n", "line 3 has the number 1e9, beyond"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 1\n", "line 3 ends before its last number"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 1 1 1\n", "line 3 has '1' after its last number"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 x 1\n", "line 3 has 'x' in place of a number"},
      {"LUT_1D_SIZE 2\n0 0 0\n1 1 1\n2 2 2\n", "line 4 has one colour more"},
      {"LUT_1D_SIZE 2\n0 0 0\nDOMAIN_MAX 1 1 1\n", "line 3 has 'DOMAIN_MAX' after the first"},
      {"LUT_1D_SIZE 2\nDOMAIN_MAX 0 1 1\n0 0 0\n1 1 1\n", "line 3 leaves an empty domain"},
      {"LUT_2D_SIZE 2\n", "line 1 has the unknown keyword 'LUT_2D_SIZE'"},
      {"\x89PNG\r\n", "line 1 has a colour or something unknown"},
  };
  for (const auto& [text, says] : kCases)
    EXPECT_REGRADE_ERROR(Parse(text), ExitCode::kInput, says);
}

TEST(CubeFile, F94_LooksOfOtherProgramsAreRefusedWithARemedy) {
  for (const char* name : {"a.xmp", "b.DTSTYLE", "/c/d.lrtemplate"})
    EXPECT_REGRADE_ERROR(StyleExample(name, nullptr), ExitCode::kInput,
                         "is a look of another program");
  EXPECT_TRUE(IsCubeFile("Film Look.CUBE"));
  EXPECT_FALSE(IsCubeFile("cube.png"));
}

TEST(CubeFile, AChartStandsForALut) {
  const testing::TemporaryFolder folder;
  const std::string path = folder.path() + "/a.cube";
  WriteFileAtomically(path, "LUT_3D_SIZE 2\n" + kCorners);
  const Image chart = StyleExample(path, nullptr);
  EXPECT_EQ(chart.channels, 3);
  EXPECT_NEAR(chart.at(0, 0)[0], 1, 1e-6);    // white above
  EXPECT_NEAR(chart.at(0, 105)[0], 1, 0.02);  // full red at half height
  EXPECT_NEAR(chart.at(0, 105)[1], 0, 0.02);
}

}  // namespace
}  // namespace regrade
