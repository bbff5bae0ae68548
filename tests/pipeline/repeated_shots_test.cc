// Two files of one shot, and brackets of exposures.
#include "pipeline/capture/repeated_shots.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"

namespace regrade {
namespace {

// A picture of patches, different for each `seed`, with `stops` more light.
ShotLook Look(const std::string& file, uint64_t seed, double stops = 0) {
  ShotLook look{file, 4000, 3000, 8, "", 0, Image(kLookSide, kLookSide, 3)};
  for (int64_t i = 0; i < look.small.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c)
      look.small.pixels[3 * i + c] = static_cast<float>(
          std::min(1.0, (0.1 + 0.5 * RandomDouble(seed, c, i)) * std::exp2(stops / 2.2)));
  return look;
}

std::vector<std::string> Taken(const std::vector<ShotLook>& photos) {
  std::vector<std::string> taken;
  const std::vector<LeftShot> left = RepeatedShots(photos);
  for (size_t i = 0; i < photos.size(); ++i)
    if (left[i].as.empty()) taken.push_back(photos[i].file);
  return taken;
}

using Names = std::vector<std::string>;

TEST(RepeatedShots, OneFileOfAShotIsTaken) {
  const ShotLook heic = Look("a/1.HEIC", 1), jpeg = Look("a/1.JPG", 1, 0.1);
  EXPECT_EQ(Taken({heic, jpeg, Look("a/2.JPG", 2)}), (Names{"a/1.HEIC", "a/2.JPG"}));
  EXPECT_EQ(RepeatedShots({heic, jpeg})[1].why, "the same shot as a/1.HEIC");
  ShotLook deep = Look("a/1.tif", 1);
  deep.bits = 16;
  EXPECT_EQ(Taken({heic, jpeg, deep}), Names{"a/1.tif"});
  ShotLook small = heic;
  small.width = 2000, small.height = 1500;
  EXPECT_EQ(Taken({small, jpeg}), Names{"a/1.JPG"});
}

TEST(RepeatedShots, OtherPicturesOfOneNameAreAllTaken) {
  EXPECT_EQ(Taken({Look("1.jpg", 1), Look("1.png", 2)}).size(), 2u);
  EXPECT_EQ(Taken({Look("a/1.jpg", 1), Look("b/1.png", 1)}).size(), 2u);  // other folders
  ShotLook cropped = Look("1.png", 1);
  cropped.height = 2000;
  EXPECT_EQ(Taken({Look("1.jpg", 1), cropped}).size(), 2u);
}

TEST(RepeatedShots, ACopyHasTheSameTimeAndLook) {
  ShotLook shot = Look("IMG_1.JPG", 1), copy = Look("copy of 1.JPG", 1);
  EXPECT_EQ(Taken({copy, shot}).size(), 2u);  // no time
  shot.taken = copy.taken = "2024:05:01 10:20:30.125";
  EXPECT_EQ(Taken({copy, shot}).size(), 1u);
  copy.taken = "2024:05:01 10:20:30.225";  // a burst
  EXPECT_EQ(Taken({copy, shot}).size(), 2u);
  ShotLook other = Look("IMG_2.JPG", 2);
  other.taken = shot.taken;
  EXPECT_EQ(Taken({shot, other}).size(), 2u);
}

ShotLook Exposure(int number, uint64_t seed, double stops, const std::string& taken) {
  ShotLook look = Look(std::to_string(number) + ".jpg", seed, stops);
  look.light = std::exp2(stops);
  look.taken = "2024:05:01 " + taken;
  return look;
}

TEST(RepeatedShots, OfABracketTheMiddleExposureIsTaken) {
  EXPECT_EQ(Taken({Exposure(1, 1, 0, "10:00:00"), Exposure(2, 1, -2, "10:00:01"),
                   Exposure(3, 1, 2, "10:00:01"), Exposure(4, 2, 0, "10:00:03"),
                   Exposure(5, 2, -2, "10:00:03"), Exposure(6, 2, 2, "10:00:04")}),
            (Names{"1.jpg", "4.jpg"}));
  // Of two the darker one.
  EXPECT_EQ(Taken({Exposure(1, 1, 1, "23:59:59"), Exposure(2, 1, -1, "23:59:59")}),
            Names{"2.jpg"});
  // One place, twice: the exposures repeat.
  EXPECT_EQ(Taken({Exposure(1, 1, 0, "10:00:00"), Exposure(2, 1, 1, "10:00:00"),
                   Exposure(3, 1, 0, "10:00:01"), Exposure(4, 1, 1, "10:00:01")}),
            (Names{"1.jpg", "3.jpg"}));
}

TEST(RepeatedShots, PhotosWithAutomaticExposureAreAllTaken) {
  // Another view, later, or nearly the same exposure.
  EXPECT_EQ(Taken({Exposure(1, 1, 0, "10:00:00"), Exposure(2, 2, 1, "10:00:01")}).size(), 2u);
  EXPECT_EQ(Taken({Exposure(1, 1, 0, "10:00:00"), Exposure(2, 1, 1, "10:00:09")}).size(), 2u);
  EXPECT_EQ(Taken({Exposure(1, 1, 0, "10:00:00"), Exposure(2, 1, 0.3, "10:00:01")}).size(), 2u);
}

}  // namespace
}  // namespace regrade
