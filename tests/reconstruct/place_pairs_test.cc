// Which photos are matched by the places in their EXIF.
#include "reconstruct/colmap/place_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr double kMeter = 1 / 111195.0;  // degrees of latitude

// A drone that flies `lines` of `per_line` photos, 20 m apart, to and fro.
std::vector<StagedPhoto> Flight(size_t lines, size_t per_line, double apart_m) {
  std::vector<StagedPhoto> photos(lines * per_line);
  for (size_t i = 0; i < photos.size(); ++i) {
    const size_t line = i / per_line, along = i % per_line;
    const double x = static_cast<double>(line % 2 == 0 ? along : per_line - 1 - along);
    photos[i].gps = GeoPosition{46.8 + apart_m * kMeter * static_cast<double>(line),
                                7 + apart_m * kMeter * x / std::cos(46.8 * M_PI / 180), 198};
  }
  return photos;
}

TEST(PlacePairs, NeighboringLinesAreMatched) {
  const size_t per_line = 25;
  const std::vector<StagedPhoto> photos = Flight(8, per_line, 20);
  EXPECT_TRUE(PlacesTellPhotosApart(photos));
  const PhotoPairs pairs = PairsOfPlaces(photos);
  EXPECT_TRUE(std::ranges::is_sorted(pairs));
  EXPECT_LT(pairs.size(), 25 * photos.size());
  for (const auto& [i, j] : pairs) EXPECT_LT(i, j);
  // The photo beside one in the middle of the fourth line is in the fifth.
  const std::pair<size_t, size_t> beside = {3 * per_line + 12, 5 * per_line - 1 - 12};
  EXPECT_TRUE(std::ranges::binary_search(pairs, beside));
  // Neighbors in order are matched in any case.
  for (size_t i = 0; i + 1 < photos.size(); ++i)
    EXPECT_TRUE(std::ranges::binary_search(pairs, std::pair(i, i + 1)));
}

TEST(PlacePairs, PhotosWithoutPlaceAreMatchedInOrder) {
  std::vector<StagedPhoto> photos = Flight(8, 25, 20);
  photos[77].gps.reset();
  EXPECT_TRUE(PlacesTellPhotosApart(photos));
  const PhotoPairs pairs = PairsOfPlaces(photos);
  EXPECT_TRUE(std::ranges::binary_search(pairs, std::pair<size_t, size_t>(76, 77)));
  for (size_t i = 0; i < 50; ++i) photos[4 * i].gps.reset();
  EXPECT_FALSE(PlacesTellPhotosApart(photos)) << "a quarter has no place";
}

// A receiver indoors errs by more than photos are apart.
TEST(PlacePairs, PlacesOfARoomSayNothing) {
  EXPECT_FALSE(PlacesTellPhotosApart(Flight(10, 20, 0.5)));
  EXPECT_FALSE(PlacesTellPhotosApart(Flight(10, 20, 0)));
  EXPECT_FALSE(PlacesTellPhotosApart(std::vector<StagedPhoto>(200)));
  EXPECT_FALSE(PlacesTellPhotosApart({}));
}

}  // namespace
}  // namespace regrade
