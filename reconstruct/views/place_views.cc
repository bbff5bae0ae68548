#include "reconstruct/views/place_views.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <tuple>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "kernels/scene/facing.h"
#include "reconstruct/views/probe_view.h"
#include "reconstruct/views/scene_extent.h"

namespace regrade {
namespace {

constexpr double kFocal = 0.9;  // over the picture's longer side: 58 degrees
constexpr int kProbeSide = 64;  // pixels
constexpr int64_t kSamples = 3000;
constexpr int64_t kProbedSplats = 200'000;  // a small picture needs no more
constexpr double kMargin = 1.2;             // around an object: a film cuts corners
constexpr double kPortrait = 0.85;    // of the distance: so much nearer shows an object upright
constexpr double kFewestHoles = 0.6;  // quality of a view over the middle one
constexpr double kFarFromBest = 0.45;  // worth of a view over the best one's
// A thin margin: objects have 1.09 to 2.3, a room whose walls look as well from behind 1.05.
constexpr double kObjectShowsMore = 1.065;
// A middle of detail that is not clearly smaller than the whole adds no places.
constexpr double kSameExtent = 0.85;
// A view is too similar to another one within this part of the radius and this angle.
constexpr double kSamePlace = 0.12, kSameWay = 0.97;

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

// What candidates are placed around.
struct Stage {
  Vec3d up, east, north;
  SplatExtent extent;

  Vec3d Way(double azimuth, double elevation) const {
    return (east * std::cos(azimuth) + north * std::sin(azimuth)) * std::cos(elevation) +
           up * std::sin(elevation);
  }
};

Camera LookAt(const Vec3d& from, const Vec3d& way, const Vec3d& up, int longest,
              bool portrait) {
  Camera camera;
  camera.width = longest, camera.height = longest * 3 / 4;
  if (portrait) std::swap(camera.width, camera.height);
  camera.fx = camera.fy = kFocal * longest;
  camera.cx = 0.5 * camera.width, camera.cy = 0.5 * camera.height;
  const Vec3d front = Normalized(way), right = Normalized(Cross(front, up));
  camera.camera_from_world = Facing(from, front, right);
  return camera;
}

struct Candidate {
  Camera camera;
  ViewProbe probe;
  double filled = 0;  // quality of the whole picture

  // How much of the scene is seen, in [0, 1].
  double Seen() const {
    double sum = 0;
    for (const float seen : probe.seen) sum += seen;
    return sum / static_cast<double>(std::max<size_t>(1, probe.seen.size()));
  }
  double Worth() const { return filled * Seen(); }
};

class Placement {
 public:
  Placement(const FieldRenderer& renderer, Stage stage, std::vector<SampledSplat> samples)
      : renderer_(renderer), stage_(std::move(stage)), samples_(std::move(samples)) {}

  // Two rings on which an object as large as this scene fits into its pictures.
  std::vector<Candidate> Rings(const ProgressFunction& progress) const {
    const Vec3d middle = Middle();
    std::vector<Vec3d> ways;
    for (const auto& [elevation, count, turn] :
         {std::tuple{6.0, 20, 0.0}, std::tuple{30.0, 16, 0.5}})
      for (int i = 0; i < count; ++i)
        ways.push_back(
            stage_.Way(2 * std::numbers::pi * (i + turn) / count, Radians(elevation)));
    double distance[2] = {};
    for (const bool portrait : {false, true})
      for (const Vec3d& way : ways)
        distance[portrait] =
            std::max(distance[portrait], FittingDistance(middle, way, portrait));
    const bool portrait = distance[1] < kPortrait * distance[0];
    std::vector<Candidate> rings;
    for (const Vec3d& way : ways) {
      ReportOrThrow(progress, static_cast<double>(rings.size()),
                    static_cast<double>(ways.size()));
      rings.push_back(Probe(middle + way * distance[portrait], -way, portrait));
    }
    return rings;
  }

  // Places near the middle, with views all round.
  std::vector<Candidate> Within(const ProgressFunction& progress) const {
    constexpr int kDirections = 10;
    std::vector<Candidate> within;
    for (const double height : {0.0, -0.25})
      for (const auto& [e, n] : {std::pair{0.0, 0.0}, std::pair{0.5, 0.0}, std::pair{0.0, 0.5},
                                 std::pair{-0.5, 0.0}, std::pair{0.0, -0.5}}) {
        ReportOrThrow(progress, static_cast<double>(within.size()), 10 * kDirections);
        const Vec3d from =
            stage_.extent.center +
            (stage_.east * e + stage_.north * n + stage_.up * height) * stage_.extent.inner;
        for (int i = 0; i < kDirections; ++i)
          within.push_back(Probe(
              from, stage_.Way(2 * std::numbers::pi * i / kDirections, Radians(-5)), false));
      }
    return within;
  }

  // Places around a middle, at distances in units of its inner radius, which look at it.
  std::vector<Candidate> Around(const SplatExtent& extent, const std::vector<double>& distances,
                                const ProgressFunction& progress) const {
    constexpr int kDirections = 12;
    std::vector<Candidate> around;
    int done = 0;
    for (const double distance : distances)
      for (const double elevation : {-8.0, 8.0, 24.0, 45.0, 70.0}) {
        ReportOrThrow(progress, done, 5.0 * static_cast<double>(distances.size()));
        const double turn = 0.5 * (done++ % 2);
        for (int i = 0; i < kDirections; ++i) {
          const Vec3d way =
              stage_.Way(2 * std::numbers::pi * (i + turn) / kDirections, Radians(elevation));
          around.push_back(Probe(extent.center + way * (distance * extent.inner), -way, false));
        }
      }
    return around;
  }

  // Places beside each of these, which look at the middle, or on as they do near to it.
  std::vector<Candidate> Beside(const std::vector<Candidate>& views,
                                const ProgressFunction& progress) const {
    constexpr double kStep = 0.22;  // of the distance to the middle
    std::vector<Candidate> beside;
    for (const Candidate& view : views) {
      ReportOrThrow(progress, static_cast<double>(beside.size()),
                    6.0 * static_cast<double>(views.size()));
      const Vec3d from = view.camera.Center(), to = stage_.extent.center - from;
      const bool looks_at_it = Dot(Normalized(to), view.camera.Forward()) > kSameWay;
      const double step = kStep * std::max(Norm(to), 0.5 * stage_.extent.inner);
      const Mat3d& axes = view.camera.camera_from_world.rotation;
      for (const Vec3d& axis : axes.row)
        for (const double side : {-step, step}) {
          const Vec3d place = from + axis * side;
          beside.push_back(
              Probe(place, looks_at_it ? stage_.extent.center - place : view.camera.Forward(),
                    false));
        }
    }
    return beside;
  }

  // The candidates that show most together; each counts less what others show already.
  std::vector<Candidate> Choose(std::vector<Candidate> all) const {
    double best = 0;
    for (const Candidate& candidate : all) best = std::max(best, candidate.Worth());
    std::erase_if(all, [best](const Candidate& candidate) {
      return !(candidate.Worth() > kFarFromBest * best);
    });
    std::vector<Candidate> chosen;
    std::vector<double> shown(samples_.size(), 0);
    while (std::ssize(chosen) < kMostPlacedViews && !all.empty()) {
      double most = -1;
      size_t next = 0;
      for (size_t i = 0; i < all.size(); ++i) {
        double gain = 0;
        for (size_t k = 0; k < shown.size(); ++k)
          gain += double{all[i].probe.seen[k]} / (1 + shown[k]);
        gain *= all[i].filled;
        if (gain > most) most = gain, next = i;
      }
      for (size_t k = 0; k < shown.size(); ++k)
        shown[k] += double{all[next].probe.seen[k]} * all[next].filled;
      chosen.push_back(all[next]);
      std::erase_if(all, [&](const Candidate& other) {
        const Camera &a = chosen.back().camera, &b = other.camera;
        return Norm(a.Center() - b.Center()) < kSamePlace * stage_.extent.radius &&
               Dot(a.Forward(), b.Forward()) > kSameWay;
      });
    }
    return chosen;
  }

 private:
  Candidate Probe(const Vec3d& from, const Vec3d& way, bool portrait) const {
    Candidate candidate{LookAt(from, way, stage_.up, kProbeSide, portrait), {}};
    candidate.probe = ProbeView(renderer_, candidate.camera, samples_);
    // What is right before the camera hides the rest, and a film would pass through it.
    const bool free = candidate.probe.nearest > 0.1 * stage_.extent.inner;
    candidate.filled =
        free ? std::pow(candidate.probe.opaque, 3) * candidate.probe.Quality() : 0;
    return candidate;
  }

  // Of the box with all but a hundredth of the samples at each end.
  Vec3d Middle() const {
    Vec3d middle;
    for (const Vec3d& axis : {stage_.up, stage_.east, stage_.north}) {
      std::vector<double> along;
      for (const SampledSplat& sample : samples_) along.push_back(Dot(axis, sample.mean));
      middle = middle + axis * (0.5 * (Quantile(along, 0.01) + Quantile(along, 0.99)));
    }
    return middle;
  }

  // At which nearly all samples are in the picture from there.
  double FittingDistance(const Vec3d& middle, const Vec3d& way, bool portrait) const {
    const Camera camera = LookAt(middle, -way, stage_.up, 1000, portrait);
    const double wide = 0.5 * camera.width / camera.fx, high = 0.5 * camera.height / camera.fy;
    std::vector<double> needed;
    for (const SampledSplat& sample : samples_) {
      const Vec3d p = camera.camera_from_world * sample.mean;
      needed.push_back(std::max(std::abs(p.x) / wide, std::abs(p.y) / high) - p.z);
    }
    return kMargin * Quantile(needed, 0.99);
  }

  const FieldRenderer& renderer_;
  Stage stage_;
  std::vector<SampledSplat> samples_;
};

// The part of the samples that the candidates show together, each as well as the best of them.
double ShownBy(const std::vector<Candidate>& candidates, const auto& quality) {
  std::vector<double> best(candidates.at(0).probe.seen.size(), 0);
  for (const Candidate& candidate : candidates)
    for (size_t k = 0; k < best.size(); ++k)
      best[k] = std::max(best[k], quality(candidate) * double{candidate.probe.seen[k]});
  double sum = 0;
  for (const double shown : best) sum += shown;
  return sum / static_cast<double>(std::max<size_t>(1, best.size()));
}

std::vector<Candidate> WithoutHoles(std::vector<Candidate> views) {
  std::vector<double> quality;
  for (const Candidate& view : views) quality.push_back(view.probe.Quality());
  const double least = kFewestHoles * Median(quality);
  std::erase_if(views, [least](const Candidate& view) {
    return view.probe.Quality() < least || view.probe.empty > 0.995;
  });
  return views;
}

Stage StageOf(const Splats& splats, const Vec3d& up) {
  Stage stage{up, {}, {}, ExtentOf(splats)};
  const Vec3d some = std::abs(up.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 0, 1};
  stage.east = Normalized(Cross(some, up));
  stage.north = Cross(up, stage.east);
  return stage;
}

}  // namespace

PlacedViews PlaceViews(const Splats& splats, const RadianceField& field, Backend backend,
                       const Vec3d& up, int longest, const std::string& where,
                       const ProgressFunction& progress) {
  const FieldRenderer renderer(FieldForProbes(splats, field, kProbedSplats), backend);
  const Stage stage = StageOf(splats, up);
  const Placement placement(renderer, stage, SampleSplats(splats, kSamples));
  ProgressParts parts(progress, 6);
  const std::vector<Candidate> rings = placement.Rings(parts.Next(0.5));
  std::vector<Candidate> all = placement.Within(parts.Next(1));
  const auto add = [&](const SplatExtent& extent, const std::vector<double>& distances,
                       double part) {
    std::ranges::move(placement.Around(extent, distances, parts.Next(part)),
                      std::back_inserter(all));
  };
  add(stage.extent, {0.7, 1.1, 1.7, 2.6}, 2);
  const double outside = ShownBy(rings, [](const Candidate&c) { return c.probe.Quality(); }),
               filled = ShownBy(all, [](const Candidate&c) { return c.filled; });
  const bool object = outside > kObjectShowsMore * filled;
  std::vector<Candidate> chosen;
  if (object) {
    chosen = WithoutHoles(rings);
  } else {
    add(stage.extent, {4.0}, 0.5);
    // Where photos went around a small part of what they show, that is where detail is.
    if (const SplatExtent fine = ExtentOf(splats, SplatWeight::kDetail);
        !(fine.inner > kSameExtent * stage.extent.inner))
      add(fine, {0.7, 1.1, 1.7, 2.6, 4.0}, 1);
    chosen = placement.Choose(all);
    if (chosen.size() < kMostPlacedViews) {  // good places are few: look beside them
      std::ranges::move(placement.Beside(chosen, parts.Next(1)), std::back_inserter(all));
      chosen = placement.Choose(std::move(all));
    }
  }
  if (chosen.size() < 2 || !(std::max(outside, filled) > 0))
    throw InputError("no place shows the splats without holes", where,
                     "give the cameras of its photos: --cameras");
  PlacedViews placed;
  for (const Candidate& candidate : chosen) {
    const Camera& small = candidate.camera;
    const int across = longest * 3 / 4;
    placed.cameras.push_back(small.width > small.height ? small.Resized(longest, across)
                                                        : small.Resized(across, longest));
  }
  placed.summary = Format(
      "%s: %zu views (two rings around it show %.0f %% of it well, the best views that it "
      "fills %.0f %%)",
      object ? "an object, seen from outside" : "a scene with surroundings, seen from within",
      chosen.size(), 100 * outside, 100 * filled);
  return placed;
}

}  // namespace regrade
