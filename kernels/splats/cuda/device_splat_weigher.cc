#include "kernels/splats/cuda/device_splat_weigher.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/splats/cuda/grow_buffer.h"
#include "kernels/splats/cuda/see_splats.h"

namespace regrade {
namespace {

constexpr int64_t kSamplesOfRay = 24;  // there is room for from the start

Camera PinholeOf(Camera camera) {
  camera.ndc = {};  // splats are in the world
  return camera;
}

}  // namespace

DeviceSplatWeigher::DeviceSplatWeigher(const SplatsView<float>& splats,
                                       const SplatOptions& options, int64_t kept_bytes)
    : options_(options), left_bytes_(kept_bytes) {
  SplatsView<float> shapes = splats;
  shapes.sh = nullptr;
  shapes.basis = 0;
  splats_.Upload(shapes);
  GrowBuffer(splats.count, "splats of a picture", &record_);
  GrowBuffer(splats.count, "tiles of splats", &num_tiles_);
  GrowBuffer(splats.count, "order of splats", &index_);
  GrowBuffer(splats.count, "order of splats", &z_bits_);
}

int32_t DeviceSplatWeigher::ViewOf(const Camera& camera, int32_t first_guess) {
  const auto is = [&](const View& view) { return SameView(view.camera, camera); };
  if (first_guess < std::ssize(views_) && is(views_[static_cast<size_t>(first_guess)]))
    return first_guess;
  const auto found = std::ranges::find_if(views_, is);
  const int32_t index = static_cast<int32_t>(found - views_.begin());
  if (found == views_.end()) {
    REGRADE_CHECK(camera.lens == LensModel::kPinhole);
    views_.push_back({PinholeOf(camera), {}});
    lists_.emplace_back();
  }
  return index;
}

std::vector<ViewPlace> DeviceSplatWeigher::PlacesOf(const std::vector<Group>& groups,
                                                    int64_t rays) {
  std::vector<ViewPlace> places(groups.size() * static_cast<size_t>(rays), {-1, 0, 0});
  for (size_t g = 0; g < groups.size(); ++g) {
    const Group& group = groups[g];
    REGRADE_CHECK(group.end - group.begin <= rays);
    if (group.begin == group.end) continue;
    const std::vector<Camera>& cameras = group.rays->cameras;
    std::vector<int32_t> view_of(cameras.size(), -1);
    for (int64_t r = group.begin; r < group.end; ++r) {
      ViewPlace place = group.rays->places[static_cast<size_t>(r)];
      const size_t at = static_cast<size_t>(place.camera);
      const Camera& camera = cameras[at];
      REGRADE_CHECK(place.u >= 0 && place.u < camera.width && place.v >= 0 &&
                    place.v < camera.height);
      if (view_of[at] < 0) view_of[at] = ViewOf(camera, place.camera);
      place.camera = view_of[at];
      places[g * static_cast<size_t>(rays) + static_cast<size_t>(r - group.begin)] = place;
    }
  }
  return places;
}

int64_t DeviceSplatWeigher::MakeTiles(const Camera& camera) {
  const TileGrid grid(camera.width, camera.height);
  const SeenSplats seen{record_.data(), num_tiles_.data(), z_bits_.data(), index_.data()};
  SeeSplatsOnDevice(splats_.view(), SplatCamera(camera), options_, grid, seen);
  tiles_.Make(seen, splats_.count, grid);
  return 2 * int64_t{grid.count()} + tiles_.num_entries();
}

CameraLists DeviceSplatWeigher::StoreTiles(const Camera& camera,
                                           const DeviceBuffer<int32_t>& lists) const {
  const TileListsView view = tiles_.view();
  const int64_t tiles = view.grid.count(), bytes = tiles * int64_t{sizeof(int32_t)};
  int32_t *const first = lists.data(), *const end = first + tiles, *const splat = end + tiles;
  DeviceCopyWithin(first, view.first, bytes);
  DeviceCopyWithin(end, view.end, bytes);
  tiles_.CopySplats(splat);
  return {SplatCamera(camera), view.grid.columns, first, end, splat};
}

void DeviceSplatWeigher::WeighViews(const std::vector<bool>& used, const PlaceGroups& places,
                                    float min_weight, const SplatSamplesView& samples) {
  const int64_t n = std::ssize(views_);
  GrowBuffer(n, "lists of cameras", &table_);
  const auto weigh = [&](const std::vector<CameraLists>& lists, int32_t only) {
    table_.CopyIn(lists.data(), n);
    WeighPlaces(splats_.view(), options_, table_.data(), only, places, min_weight, samples);
  };
  for (size_t v = 0; v < views_.size(); ++v) {
    View& view = views_[v];
    if (!used[v] || !view.lists.empty()) continue;
    const int64_t size = MakeTiles(view.camera), bytes = size * int64_t{sizeof(int32_t)};
    if (bytes <= left_bytes_) {
      left_bytes_ -= bytes;
      view.lists = DeviceBuffer<int32_t>(size, "splats of tiles");
      lists_[v] = StoreTiles(view.camera, view.lists);
      continue;
    }
    GrowBuffer(size, "splats of tiles", &passing_);
    std::vector<CameraLists> alone(views_.size());
    alone[v] = StoreTiles(view.camera, passing_);
    weigh(alone, static_cast<int32_t>(v));
  }
  weigh(lists_, -1);
}

void DeviceSplatWeigher::Weigh(const std::vector<Group>& groups, int64_t rays, float min_weight,
                               DeviceSplatSamples* samples) {
  const DeviceRange range("weights of splats");
  const int64_t n = std::ssize(groups);
  const std::vector<ViewPlace> places = PlacesOf(groups, rays);
  std::vector<bool> used(views_.size());
  for (const ViewPlace& place : places)
    if (place.camera >= 0) used[static_cast<size_t>(place.camera)] = true;
  GrowBuffer(n * rays, "places of rays", &places_);
  places_.CopyIn(places.data(), n * rays);
  GrowBuffer(n * rays, "transmittances of rays", &samples->transmittance);
  GrowBuffer(n, "samples of rays", &samples->count);
  GrowBuffer(n * rays * kSamplesOfRay, "samples of rays", &samples->sample);
  samples->groups = n;
  samples->rays = rays;
  std::vector<int32_t> count(groups.size());
  for (;;) {
    samples->capacity = samples->sample.size() / std::max<int64_t>(n, 1);
    samples->count.Zero();
    WeighViews(used, {places_.data(), n, rays}, min_weight, samples->view());
    samples->count.CopyOut(count.data(), n);
    samples->most = count.empty() ? 0 : std::ranges::max(count);
    if (samples->most <= samples->capacity) return;
    GrowBuffer(n * (samples->most + samples->most / 4), "samples of rays", &samples->sample);
  }
}

}  // namespace regrade
