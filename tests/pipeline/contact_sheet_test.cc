// Contact sheets: every picture in its cell, text outside the pictures.
#include "pipeline/images/contact_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/images/draw_text.h"
#include "tests/support/pictures.h"

namespace regrade {
namespace {

TEST(ContactSheet, EveryPictureIsThereWhole) {
  const Image sheet =
      MakeContactSheet({{{testing::ConstantImage(40, 30, 0.25f), "28.1 dB"},
                         {testing::ConstantImage(30, 30, 0.5f), ""}},
                        {{testing::ConstantImage(40, 20, 0.75f), "x"}, {Image(), "nothing"}}});
  int quarter = 0, half = 0, three = 0, ink = 0;
  for (int64_t i = 0; i < sheet.num_pixels(); ++i) {
    const float v = sheet.pixels[static_cast<size_t>(3 * i)];
    quarter += v == 0.25f, half += v == 0.5f, three += v == 0.75f, ink += v != 1;
  }
  EXPECT_GE(quarter, 40 * 30);
  EXPECT_GE(half, 30 * 30);
  EXPECT_GE(three, 40 * 20);
  EXPECT_LE(quarter, 40 * 30 + 100);                 // only edges of letters may be in it
  EXPECT_GT(ink, 40 * 30 + 30 * 30 + 40 * 20 + 20);  // the captions, too
  EXPECT_GT(sheet.width, 80);
  EXPECT_EQ(MakeContactSheet({}).channels, 3);
}

TEST(PictureText, StaysWithinItsWidthAndThePicture) {
  Image image = testing::ConstantImage(60, 30, 1);
  DrawText(&image, 10, 4, 20, "WWWWWWWWWWWW", 1, 0);
  int left = 0, inside = 0, right = 0;
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 60; ++x) {
      const bool dark = *image.at(x, y) < 0.5f;
      (x < 10 ? left : x < 30 ? inside : right) += dark;
    }
  EXPECT_EQ(left, 0);
  EXPECT_GT(inside, 10);
  EXPECT_EQ(right, 0);
  DrawText(&image, 50, 25, 500, "\xF0\x9F\x98\x80 beyond", 2, 0);  // no crash at the border
  DrawText(&image, -5, -5, 50, "x", 1, 0);
}

// The end of a line that is too long, for example a title over narrow columns.
TEST(PictureText, ALineThatIsTooLongIsDrawnSmaller) {
  const auto ink_at = [](const std::string& text) {
    Image image = testing::ConstantImage(120, 30, 1);
    DrawText(&image, 0, 0, 100, text, 1, 0);
    int ink = 0;
    for (int y = 0; y < 30; ++y)
      for (int x = 70; x < 100; ++x) ink += *image.at(x, y) < 0.5f;
    return ink;
  };
  const std::string spaces(14, ' ');
  EXPECT_GT(ink_at(spaces + "WW"), 10);
  EXPECT_EQ(ink_at(spaces + spaces + spaces + "WW"), 0);  // smaller than half is not drawn
}

}  // namespace
}  // namespace regrade
