#include "reconstruct/views/place_views.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <tuple>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/views/probe_view.h"
#include "reconstruct/views/splat_extent.h"

namespace regrade {
namespace {

constexpr double kFocal = 0.9;  // over the picture's width: 58 degrees wide
constexpr int kProbeWidth = 64, kProbeHeight = 48;
constexpr int64_t kSamples = 3000;
// An object's pictures: most of their edges are empty.
constexpr double kAlone = 0.7;
// How much more a scene must show from within than from outside to be taken for a room.
constexpr double kRoomShowsMore = 1.3;
constexpr double kFewestHoles = 0.6;  // quality of a view over the middle one
constexpr double kFarFromBest = 0.3;  // worth of a view over the best one's
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

Camera LookAt(const Vec3d& from, const Vec3d& way, const Vec3d& up, int width) {
  Camera camera;
  camera.width = width, camera.height = width * 3 / 4;
  camera.fx = camera.fy = kFocal * width;
  camera.cx = 0.5 * camera.width, camera.cy = 0.5 * camera.height;
  const Vec3d front = Normalized(way), right = Normalized(Cross(front, up));
  camera.camera_from_world.rotation.row[0] = right;
  camera.camera_from_world.rotation.row[1] = Cross(front, right);
  camera.camera_from_world.rotation.row[2] = front;
  camera.camera_from_world.translation = -(camera.camera_from_world.rotation * from);
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
  Placement(const FieldRenderer& renderer, Stage stage, std::vector<SplatSample> samples)
      : renderer_(renderer), stage_(std::move(stage)), samples_(std::move(samples)) {}

  Candidate Probe(const Vec3d& from, const Vec3d& way) const {
    Candidate candidate{LookAt(from, way, stage_.up, kProbeWidth), {}};
    candidate.probe = ProbeView(renderer_, candidate.camera, samples_);
    // What is right before the camera hides the rest, and a film would pass through it.
    const bool free = candidate.probe.nearest > 0.1 * stage_.extent.inner;
    candidate.filled =
        free ? std::pow(candidate.probe.opaque, 3) * candidate.probe.Quality() : 0;
    return candidate;
  }

  std::vector<Candidate> Ring(double distance, double elevation, int count,
                              double turn) const {
    std::vector<Candidate> ring;
    for (int i = 0; i < count; ++i) {
      const Vec3d way =
          stage_.Way(2 * std::numbers::pi * (i + turn) / count, Radians(elevation));
      ring.push_back(Probe(stage_.extent.center + way * distance, -way));
    }
    return ring;
  }

  // Places near the middle, with views all round.
  std::vector<Candidate> Within(const ProgressFunction& progress) const {
    std::vector<Candidate> within;
    constexpr int kDirections = 12;
    constexpr double kSteps[] = {0, -0.5, 0.5};
    int done = 0;
    for (const double height : {0.0, -0.25})
      for (const double e : kSteps)
        for (const double n : kSteps) {
          ReportOrThrow(progress, done++, 18);
          const Vec3d from =
              stage_.extent.center + (stage_.east * e + stage_.north * n +
                                      stage_.up * height) * stage_.extent.inner;
          for (int i = 0; i < kDirections; ++i)
            within.push_back(Probe(
                from, stage_.Way(2 * std::numbers::pi * i / kDirections, Radians(-5))));
        }
    return within;
  }

  std::vector<Candidate> Around(const ProgressFunction& progress) const {
    std::vector<Candidate> around;
    int done = 0;
    for (const double distance : {0.6, 1.0, 1.5, 2.1, 3.0})
      for (const double elevation : {-8.0, 8.0, 24.0, 45.0}) {
        ReportOrThrow(progress, done, 20);
        std::ranges::move(
            Ring(distance * stage_.extent.radius, elevation, 16, 0.5 * (done++ % 2)),
            std::back_inserter(around));
      }
    return around;
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
  const FieldRenderer& renderer_;
  Stage stage_;
  std::vector<SplatSample> samples_;
};

// At which an object fits into the picture's height.
double FittingDistance(const SplatExtent& extent) {
  constexpr double kMargin = 1.02;
  const double half_height = 0.5 * 0.75 / kFocal;  // tangent of half the angle
  return kMargin * extent.outer * std::sqrt(1 + 1 / (half_height * half_height));
}

double MeanOf(const std::vector<Candidate>& candidates,
              const auto& value) {
  double sum = 0;
  for (const Candidate& candidate : candidates) sum += value(candidate);
  return sum / static_cast<double>(std::max<size_t>(1, candidates.size()));
}

// The best tenth counts: most places in a scene are bad.
double WorthOfBest(const std::vector<Candidate>& candidates) {
  std::vector<double> worth;
  for (const Candidate& candidate : candidates) worth.push_back(candidate.Worth());
  return Quantile(worth, 0.9);
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

PlacedViews PlaceViews(const Splats& splats, const FieldRenderer& renderer, const Vec3d& up,
                       int longest, const std::string& where,
                       const ProgressFunction& progress) {
  const Stage stage = StageOf(splats, up);
  const Placement placement(renderer, stage, SampleSplats(splats, kSamples));
  ProgressParts parts(progress, 3);
  const double distance = FittingDistance(stage.extent);
  std::vector<Candidate> rings;
  for (const auto& [elevation, count, turn] :
       {std::tuple{4.0, 14, 0.0}, std::tuple{22.0, 12, 0.5}, std::tuple{45.0, 10, 0.0}})
    std::ranges::move(placement.Ring(distance, elevation, count, turn),
                      std::back_inserter(rings));
  ReportOrThrow(parts.Next(1), 1, 1);
  const double border = MeanOf(rings, [](const Candidate& c) { return c.probe.border; });
  std::vector<Candidate> all = placement.Within(parts.Next(1));
  // An object does not fill its pictures.
  const auto worth_of_object = [](const Candidate& c) { return c.probe.Quality() * c.Seen(); };
  const double outside = MeanOf(rings, worth_of_object), within = WorthOfBest(all);
  const bool alone = border > kAlone, object = alone && within < kRoomShowsMore * outside;
  PlacedViews placed;
  std::vector<Candidate> chosen;
  std::string kind;
  if (object) {
    chosen = WithoutHoles(rings);
    kind = "an object seen from outside";
  } else {
    std::ranges::move(placement.Around(parts.Next(1)), std::back_inserter(all));
    chosen = placement.Choose(std::move(all));
    kind = alone ? "a room seen from within" : "a scene with surroundings";
  }
  if (chosen.size() < 2)
    throw InputError("no place shows the splats without holes", where,
                     "give the cameras of its photos: --cameras");
  for (const Candidate& candidate : chosen) {
    Camera camera = candidate.camera.Resized(longest, longest * 3 / 4);
    placed.cameras.push_back(camera);
  }
  placed.summary = Format(
      "%s (edges of its pictures are %.0f %% empty; it shows %.3f from within, %.3f from "
      "outside): %zu views",
      kind.c_str(), 100 * border, within, outside, placed.cameras.size());
  return placed;
}

}  // namespace regrade
