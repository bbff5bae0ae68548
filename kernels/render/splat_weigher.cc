#include "kernels/render/splat_weigher.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/compositing.h"
#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/splat_field.h"

namespace regrade {
namespace {

constexpr int64_t kListsAtOnce = int64_t{256} << 20;  // bytes, of lists that are not kept

// A rectangle of places, pixels.
struct PlaceBox {
  double u0 = INFINITY, v0 = INFINITY, u1 = -INFINITY, v1 = -INFINITY;

  PlaceBox() = default;
  // Around what sees a splat, see EQ(splat-extent); a little wider, for rounding.
  explicit PlaceBox(const SeenSplat<float>& splat) {
    const ScreenEllipse<float>& e = splat.ellipse;
    const double radius = std::sqrt(double{splat.reach}) * (1 + kExtentMargin) + kExtentMargin;
    const double across = radius * double{e.c00};
    const double down =
        radius * std::sqrt(double{e.c10} * double{e.c10} + double{e.c11} * double{e.c11});
    u0 = e.u - across, u1 = e.u + across, v0 = e.v - down, v1 = e.v + down;
  }
  void Add(const ViewPlace& place) {
    u0 = std::min(u0, place.u), u1 = std::max(u1, place.u);
    v0 = std::min(v0, place.v), v1 = std::max(v1, place.v);
  }
  bool Meets(const PlaceBox& other) const {
    return u1 >= other.u0 && u0 <= other.u1 && v1 >= other.v0 && v0 <= other.v1;
  }
  bool Has(const ViewPlace& place) const {
    return place.u >= u0 && place.u <= u1 && place.v >= v0 && place.v <= v1;
  }
};

// The median depth, see EQ(splat-composite).
double SplatDepth(const SplatGeometry& splats, const Camera& camera, const RayWeights& weights,
                  int64_t ray) {
  double seen = 0;
  for (int64_t i = weights.first[static_cast<size_t>(ray)];
       i < weights.first[static_cast<size_t>(ray) + 1]; ++i) {
    const WeightedSample& sample = weights.samples[static_cast<size_t>(i)];
    seen += double{sample.weight};
    if (seen < 0.5) continue;
    const float* const mean = splats.mean.data() + 3 * int64_t{sample.vertex};
    return (camera.camera_from_world * Vec3f{mean[0], mean[1], mean[2]}.Cast<double>()).z;
  }
  return 0;
}

}  // namespace

int64_t SplatWeigher::TileLists::bytes() const {
  return static_cast<int64_t>(first.size() * sizeof(int64_t) + splat.size() * sizeof(int32_t));
}

SplatWeigher::SplatWeigher(const Geometry& geometry, float near_clip, int64_t kept_bytes)
    : splats_(SplatsWithoutColors(geometry.splats)),
      options_(
          SplatOptionsFor(near_clip, geometry.frame.radius, double{geometry.splats.fit_pixel})),
      left_bytes_(kept_bytes) {}

std::shared_ptr<const SplatWeigher::TileLists> SplatWeigher::ListsOf(const Camera& camera) {
  if (last_ != nullptr && SameView(last_->camera, camera)) return last_;
  for (const auto& lists : kept_)
    if (SameView(lists->camera, camera)) return lists;
  Camera pinhole = camera;  // splats are in the world
  pinhole.ndc = {};
  SplatFrame frame = MakeSplatFrame(splats_, pinhole, options_);
  auto lists = std::make_shared<TileLists>();
  lists->camera = camera;
  lists->numbers = frame.camera;
  lists->first = std::move(frame.first_entry);
  lists->splat = std::move(frame.entry_splat);
  last_ = lists;
  if (lists->bytes() <= left_bytes_) {
    left_bytes_ -= lists->bytes();
    kept_.push_back(lists);
  }
  return lists;
}

void SplatWeigher::WeighGroup(const ViewRays& rays, int64_t begin, Group* group,
                              RayWeights* result) const {
  const size_t n = group->rays.size();
  std::vector<PixelState<float>> states(n);
  std::vector<ViewPlace> places;
  PlaceBox box;
  for (const int64_t r : group->rays) {
    places.push_back(rays.places[static_cast<size_t>(begin + r)]);
    box.Add(places.back());
  }
  std::vector<int32_t> open(n);  // rays that have not ended
  std::iota(open.begin(), open.end(), 0);
  const TileLists& lists = *group->lists;
  const size_t tile = static_cast<size_t>(group->tile);
  for (int64_t e = lists.first[tile]; e < lists.first[tile + 1] && !open.empty(); ++e) {
    const int32_t k = lists.splat[static_cast<size_t>(e)];
    SeenSplat<float> splat;
    if (!SeeSplat(lists.numbers, options_, splats_, k, &splat)) continue;
    const PlaceBox sees(splat);
    if (!sees.Meets(box)) continue;
    const Vec3f direction = DirectionToMean(lists.numbers.center, splats_[k].mean).unit;
    size_t left = 0;
    for (const int32_t i : open) {
      const ViewPlace& place = places[static_cast<size_t>(i)];
      PixelState<float>& state = states[static_cast<size_t>(i)];
      SplatHit<float> hit;
      if (sees.Has(place) &&
          HitSplatAt(splat.ellipse, splat.log_opacity, splat.reach, place.u, place.v, &hit)) {
        const float weight = state.transmittance * hit.alpha;
        if (!CompositeSplat(hit.alpha, Vec3f{}, 0.0f, &state)) continue;
        if (weight > min_weight) {
          group->samples.push_back({k, {0, 0, 0}, weight});
          group->directions.push_back(direction);
          group->ray.push_back(i);
        }
      }
      open[left++] = i;
    }
    open.resize(left);
  }
  for (size_t i = 0; i < n; ++i)
    result->transmittance[static_cast<size_t>(group->rays[i])] = states[i].transmittance;
  for (const int32_t i : group->ray)
    ++result->first[static_cast<size_t>(group->rays[static_cast<size_t>(i)]) + 1];
}

RayWeights SplatWeigher::Weigh(const ViewRays& rays, int64_t begin, int64_t end) {
  const int64_t n = end - begin;
  RayWeights result;
  result.transmittance.assign(static_cast<size_t>(n), 1.0f);
  result.first.assign(static_cast<size_t>(n) + 1, 0);
  std::vector<std::tuple<int32_t, int, int64_t>> order;  // camera, tile, ray
  for (int64_t r = 0; r < n; ++r) {
    const ViewPlace& place = rays.places[static_cast<size_t>(begin + r)];
    const Camera& camera = rays.cameras[static_cast<size_t>(place.camera)];
    REGRADE_CHECK(place.u >= 0 && place.u < camera.width && place.v >= 0 &&
                  place.v < camera.height);
    const int tiles_x = (camera.width + kSplatTile - 1) / kSplatTile;
    order.emplace_back(place.camera,
                       static_cast<int>(place.v) / kSplatTile * tiles_x +
                           static_cast<int>(place.u) / kSplatTile,
                       r);
  }
  std::sort(order.begin(), order.end());
  std::vector<Group> groups;
  size_t weighed = 0;
  const auto weigh = [&] {
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t g = weighed; g < groups.size(); ++g) {
      WeighGroup(rays, begin, &groups[g], &result);
      groups[g].lists.reset();
    }
    weighed = groups.size();
  };
  int64_t bytes = 0;
  for (size_t i = 0; i < order.size();) {
    const int32_t camera = std::get<0>(order[i]);
    const auto lists = ListsOf(rays.cameras[static_cast<size_t>(camera)]);
    bytes += lists->bytes();
    while (i < order.size() && std::get<0>(order[i]) == camera) {
      Group group{.lists = lists, .tile = std::get<1>(order[i])};
      for (; i < order.size() && std::get<0>(order[i]) == camera &&
             std::get<1>(order[i]) == group.tile;
           ++i)
        group.rays.push_back(std::get<2>(order[i]));
      groups.push_back(std::move(group));
    }
    if (bytes < kListsAtOnce) continue;
    weigh();
    bytes = 0;
  }
  weigh();
  std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
  result.samples.resize(static_cast<size_t>(result.first.back()));
  result.directions.resize(result.samples.size());
  std::vector<int64_t> next(result.first.begin(), result.first.end() - 1);
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t g = 0; g < groups.size(); ++g) {
    const Group& group = groups[g];
    for (size_t s = 0; s < group.samples.size(); ++s) {
      const int64_t ray = group.rays[static_cast<size_t>(group.ray[s])];
      const size_t to = static_cast<size_t>(next[static_cast<size_t>(ray)]++);
      result.samples[to] = group.samples[s];
      result.directions[to] = group.directions[s];
    }
  }
  return result;
}

std::unique_ptr<RayWeigher> MakeSplatWeigher(const Geometry& geometry, float near_clip,
                                             const MarchOptions&, int64_t kept_bytes) {
  return std::make_unique<SplatWeigher>(geometry, near_clip, kept_bytes);
}

std::vector<double> SplatDepths(const RadianceField& field, const ViewRays& rays,
                                RayWeigher* weigher) {
  const RayWeights weights = weigher->Weigh(rays);
  std::vector<double> depths(rays.rays.size());
  for (int64_t r = 0; r < rays.size(); ++r)
    depths[static_cast<size_t>(r)] =
        SplatDepth(field.geometry->splats, rays.CameraOf(r), weights, r);
  return depths;
}

}  // namespace regrade
