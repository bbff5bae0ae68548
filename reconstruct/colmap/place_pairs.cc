#include "reconstruct/colmap/place_pairs.h"

#include <algorithm>
#include <set>

#include "kernels/base/quantile.h"
#include "kernels/scene/geo_position.h"
#include "kernels/scene/nearest_points.h"

namespace regrade {
namespace {

constexpr int kNearPhotos = 20;
constexpr size_t kPhotosInOrder = 5;   // that follow
constexpr double kMostPhotos = 0.9;    // of the photos know their place
constexpr double kReceiverError = 10;  // meters

// Places in meters, and whose they are.
struct Places {
  std::vector<Vec3f> meters;
  std::vector<size_t> photos;
  std::vector<int32_t> near;  // [places, kNearPhotos], -1 where there are no more
};

Places PlacesOf(const std::vector<StagedPhoto>& photos) {
  Places places;
  std::vector<GeoPosition> known;
  for (size_t i = 0; i < photos.size(); ++i)
    if (photos[i].gps) {
      known.push_back(*photos[i].gps);
      places.photos.push_back(i);
    }
  const bool heights =
      std::ranges::none_of(known, [](const GeoPosition& place) { return place.altitude == 0; });
  for (const Vec3d& place : LocalMeters(known))
    places.meters.push_back({static_cast<float>(place[0]), static_cast<float>(place[1]),
                             heights ? static_cast<float>(place[2]) : 0});
  places.near = NearestPoints(places.meters, kNearPhotos);
  return places;
}

}  // namespace

bool PlacesTellPhotosApart(const std::vector<StagedPhoto>& photos) {
  const Places places = PlacesOf(photos);
  if (static_cast<double>(places.photos.size()) <
      kMostPhotos * static_cast<double>(photos.size()))
    return false;
  std::vector<double> apart;
  for (size_t i = 0; i < places.photos.size(); ++i) {
    const int32_t last = places.near[i * kNearPhotos + kNearPhotos - 1];
    if (last < 0) return false;
    apart.push_back(Norm(places.meters[i] - places.meters[static_cast<size_t>(last)]));
  }
  return Median(std::move(apart)) > kReceiverError;
}

PhotoPairs PairsOfPlaces(const std::vector<StagedPhoto>& photos) {
  std::set<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < photos.size(); ++i)
    for (size_t j = i + 1; j < std::min(photos.size(), i + 1 + kPhotosInOrder); ++j)
      pairs.emplace(i, j);
  const Places places = PlacesOf(photos);
  for (size_t i = 0; i < places.near.size(); ++i)
    if (const int32_t other = places.near[i]; other >= 0)
      pairs.insert(std::minmax(places.photos[i / kNearPhotos],
                               places.photos[static_cast<size_t>(other)]));
  return {pairs.begin(), pairs.end()};
}

}  // namespace regrade
