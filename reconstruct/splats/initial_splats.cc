#include "reconstruct/splats/initial_splats.h"

#include <algorithm>
#include <array>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {
namespace {

double Longest(const Vec3f& radius) { return std::max({radius.x, radius.y, radius.z}); }

struct Start {
  Vec3f place;
  Vec3f color;
};

// Sums the colours of the pixels that show a place.
struct ColorSum {
  Vec3d sum;
  int count = 0;
  bool empty = false;  // a pixel shows the known background through it

  void Add(const SplatPhoto& photo, const Vec3f& place,
           const std::optional<Vec3f>& background = {}) {
    double u, v;
    const Camera& camera = photo.camera;
    if (!camera.Project(place.Cast<double>(), &u, &v)) return;
    if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return;
    const size_t pixel = static_cast<size_t>(v) * camera.width + static_cast<size_t>(u);
    if (!photo.masked.empty() && photo.masked[pixel] != 0) return;
    bool clear = background.has_value();
    for (int c = 0; c < 3; ++c) {
      const double value = photo.color[3 * pixel + c] / 65535.0;
      sum[c] += value;
      clear = clear && std::abs(value - double{(*background)[c]}) < 0.5 / 255;
    }
    empty = empty || clear;
    ++count;
  }
  Vec3f Mean() const { return (sum / std::max(count, 1)).Cast<float>(); }
};

std::vector<Start> StartsAtPoints(const std::vector<TrainingView>& views,
                                  const SplatPhotos& photos) {
  std::map<std::array<float, 3>, ColorSum> seen;
  for (int v = 0; v < photos.count(); ++v)
    for (const SeenPoint& point : views[static_cast<size_t>(v)].points) {
      const Vec3f& p = point.position;
      seen[{p.x, p.y, p.z}].Add(photos[v], p);
    }
  std::vector<Start> starts;
  for (const auto& [place, color] : seen)
    if (color.count > 0) starts.push_back({{place[0], place[1], place[2]}, color.Mean()});
  return starts;
}

// Adds random places of the box that two photos see, up to `count` starts. With a known
// background they lie in the photos' visual hull.
void AddRandomStarts(const SplatPhotos& photos, const SceneBox& box, uint64_t seed,
                     size_t count, std::vector<Start>* starts) {
  constexpr uint64_t kTries = 20;
  const int least = std::min(2, photos.count());
  const uint64_t tries = kTries * count;
  for (uint64_t i = 0; i < tries && starts->size() < count; ++i) {
    Vec3f place;
    for (uint64_t a = 0; a < 3; ++a)
      place[static_cast<int>(a)] =
          box.center[static_cast<int>(a)] +
          box.radius[static_cast<int>(a)] *
              static_cast<float>(2 * RandomDouble(seed ^ kRandomSplatPlaces, a, i) - 1);
    ColorSum color;
    for (int v = 0; v < photos.count() && !color.empty; ++v)
      color.Add(photos[v], place, box.background);
    if (color.count >= least && !color.empty) starts->push_back({place, color.Mean()});
  }
}

// The colour that most photos of a place agree on, as they do if it is there and seen; nothing
// if fewer than three photos show it, or fewer than half of them agree.
std::optional<Vec3f> AgreedColor(const SplatPhotos& photos, const Vec3f& place) {
  std::vector<Vec3f> colors;
  for (int v = 0; v < photos.count(); ++v) {
    ColorSum one;
    one.Add(photos[v], place);
    if (one.count > 0) colors.push_back(one.Mean());
  }
  if (colors.size() < kFewestAgreeing) return {};
  Vec3f median;
  for (int c = 0; c < 3; ++c) {
    const auto middle = colors.begin() + std::ssize(colors) / 2;
    std::nth_element(colors.begin(), middle, colors.end(),
                     [c](const Vec3f& x, const Vec3f& y) { return x[c] < y[c]; });
    median[c] = (*middle)[c];
  }
  const auto agrees = [&median](const Vec3f& color) {
    float most = 0;
    for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(color[c] - median[c]));
    return most < kAgreement;
  };
  const size_t agreeing = static_cast<size_t>(std::ranges::count_if(colors, agrees));
  if (agreeing < kFewestAgreeing || 2 * agreeing < colors.size()) return {};
  return median;
}

// Adds places of a sphere far outside of the box, evenly, where photos agree on a colour: the
// sky, and what is so far that they see it in one direction.
void AddFarStarts(const SplatPhotos& photos, const SceneBox& box, int64_t count,
                  std::vector<Start>* starts) {
  const double radius = kFarRadius * Longest(box.radius);
  const double turn = std::numbers::pi * (3 - std::sqrt(5.0));  // the golden angle
  for (int64_t i = 0; i < count; ++i) {
    const double k = static_cast<double>(i);
    const double z = 1 - (2 * k + 1) / static_cast<double>(count);
    const double across = std::sqrt(1 - z * z);
    const Vec3d way{across * std::cos(turn * k), across * std::sin(turn * k), z};
    const Vec3f place = box.center + (radius * way).Cast<float>();
    if (const auto color = AgreedColor(photos, place)) starts->push_back({place, *color});
  }
}

// Root mean square of the distances to the three nearest others.
std::vector<double> Spacings(const std::vector<Start>& starts) {
  namespace bg = boost::geometry;
  using Point = bg::model::point<double, 3, bg::cs::cartesian>;
  using Entry = std::pair<Point, size_t>;
  std::vector<Entry> entries;
  for (size_t i = 0; i < starts.size(); ++i) {
    const Vec3f& p = starts[i].place;
    entries.push_back({Point(p.x, p.y, p.z), i});
  }
  const bg::index::rtree<Entry, bg::index::rstar<16>> tree(entries);
  std::vector<double> spacings(starts.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (size_t i = 0; i < entries.size(); ++i) {
    std::vector<Entry> near;
    tree.query(bg::index::nearest(entries[i].first, 4), std::back_inserter(near));
    double square = 0;
    for (const Entry& entry : near)
      square += bg::comparable_distance(entry.first, entries[i].first);
    spacings[i] = std::sqrt(square / static_cast<double>(std::max<size_t>(1, near.size() - 1)));
  }
  return spacings;
}

}  // namespace

Splats InitialSplats(const std::vector<TrainingView>& views, const SplatPhotos& photos,
                     const SceneBox& box, const SplatFitOptions& options) {
  std::vector<Start> starts = StartsAtPoints(views, photos);
  const size_t most = static_cast<size_t>(options.thousands * 1000);
  if (starts.size() < kLeastPoints)
    AddRandomStarts(photos, box, options.seed, std::min(kRandomStarts, most), &starts);
  if (starts.empty())
    throw SceneError(Concat("no place is seen by two of the ", photos.count(),
                            " photos that are fitted: wrong poses, or too few"),
                     "reconstruct",
                     "check the poses against the photos, or give more photos that overlap by "
                     "two thirds");
  if (box.far_surroundings && !box.background)
    AddFarStarts(photos, box, static_cast<int64_t>(kFarShare * static_cast<double>(most)),
                 &starts);
  if (starts.size() > most) {  // evenly
    std::vector<Start> fewer;
    for (size_t k = 0; k < most; ++k) fewer.push_back(starts[k * starts.size() / most]);
    starts = std::move(fewer);
  }
  const std::vector<double> spacings = Spacings(starts);
  const double longest = Longest(box.radius);
  Splats splats(std::ssize(starts), 1);
  const float logit = std::log(options.initial_opacity / (1 - options.initial_opacity));
  for (size_t i = 0; i < starts.size(); ++i) {
    const double scale = std::max(options.initial_scale * spacings[i], 1e-7 * longest);
    const float log_scale = static_cast<float>(std::log(scale));
    splats.Set(static_cast<int64_t>(i),
               {starts[i].place, {log_scale, log_scale, log_scale}, {1, 0, 0, 0}, logit});
    for (int c = 0; c < 3; ++c)
      splats.sh[3 * i + static_cast<size_t>(c)] =
          (starts[i].color[c] - 0.5f) / static_cast<float>(kSh0);
  }
  return splats;
}

CameraSpread SpreadOf(const SplatPhotos& photos, const SceneBox& box) {
  Vec3d middle{};
  for (int v = 0; v < photos.count(); ++v) middle += photos[v].camera.Center();
  middle = middle / photos.count();
  double farthest = 0;
  for (int v = 0; v < photos.count(); ++v)
    farthest = std::max(farthest, Norm(photos[v].camera.Center() - middle));
  const double longest = Longest(box.radius);
  return {middle, std::max(1.1 * farthest, 0.01 * longest)};
}

}  // namespace regrade
