#include "stylize/field/ray_pairs.h"

#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/render/ray_weigher.h"

namespace regrade {
namespace {

constexpr uint64_t kNeighbourStream = 0x7661726961, kPointStream = 0x7661726962;
constexpr double kDepthTolerance = 0.01;  // of the point's depth, as the evaluator's
constexpr int kTries = 4;                 // pixels that are tried for each pair

// Draws below `below`, the `which`-th of draw i.
struct Draw {
  uint64_t seed, stream;
  int64_t i;

  int operator()(int which, int below) const {
    return static_cast<int>(RandomIndex(seed, stream, static_cast<uint64_t>(4 * i + which),
                                        static_cast<uint64_t>(below)));
  }
};

// Where the next view sees what a ray meets at `depth`, 0 for nothing.
std::optional<ViewPlace> PlaceInNext(const std::vector<Camera>& cameras, const ViewPlace& place,
                                     double depth, double* expected) {
  if (!(depth > 0)) return std::nullopt;
  const size_t next = (static_cast<size_t>(place.camera) + 1) % cameras.size();
  const Camera &from = cameras[static_cast<size_t>(place.camera)], &to = cameras[next];
  const RayT<double> world = from.WorldRay(place.u, place.v);
  const Vec3d point =
      world.origin + world.direction * (depth / Dot(world.direction, from.Forward()));
  double u, v;
  if (!to.Project(point, &u, &v, expected)) return std::nullopt;
  if (!(u >= 0.5 && u <= to.width - 0.5 && v >= 0.5 && v <= to.height - 0.5))
    return std::nullopt;
  return ViewPlace{static_cast<int32_t>(next), u, v};
}

}  // namespace

RayPairs NeighbouringPixels(const std::vector<Camera>& cameras, int64_t count, uint64_t seed) {
  REGRADE_CHECK(!cameras.empty());
  RayPairs pairs{.cameras = cameras};
  for (int64_t i = 0; i < count; ++i) {
    const Draw draw{seed, kNeighbourStream, i};
    const int32_t index = draw(0, static_cast<int>(cameras.size()));
    const Camera& camera = cameras[static_cast<size_t>(index)];
    const bool down = draw(1, 2) == 1;
    const int right = down ? 0 : 1, below = down ? 1 : 0;
    if (camera.width <= right || camera.height <= below) continue;
    const int x = draw(2, camera.width - right), y = draw(3, camera.height - below);
    pairs.AddPixel(index, x, y);
    pairs.AddPixel(index, x + right, y + below);
  }
  return pairs;
}

RayPairs PixelsOfOnePoint(const RadianceField& field, const std::vector<Camera>& cameras,
                          int64_t count, uint64_t seed, RayWeigher* weigher) {
  RayPairs pairs{.cameras = cameras};
  if (cameras.size() < 2) return pairs;
  for (int round = 0; round < kTries && pairs.size() < 2 * count; ++round) {
    ViewRays from{.cameras = cameras}, to{.cameras = cameras};
    for (int64_t i = 0; i < count; ++i) {
      const Draw draw{seed, kPointStream, round * count + i};
      const int32_t index = draw(0, static_cast<int>(cameras.size()));
      const Camera& camera = cameras[static_cast<size_t>(index)];
      const int x = draw(1, camera.width), y = draw(2, camera.height);
      from.AddPixel(index, x, y);
    }
    const std::vector<double> depths = RayDepths(field, from, weigher);
    std::vector<size_t> source;
    std::vector<double> expected;
    for (size_t i = 0; i < depths.size(); ++i) {
      double depth = 0;
      const auto place = PlaceInNext(cameras, from.places[i], depths[i], &depth);
      if (!place) continue;
      to.Add(place->camera, place->u, place->v);
      source.push_back(i);
      expected.push_back(depth);
    }
    const std::vector<double> seen = RayDepths(field, to, weigher);
    for (size_t k = 0; k < seen.size() && pairs.size() < 2 * count; ++k) {
      if (!(std::abs(seen[k] / expected[k] - 1) <= kDepthTolerance)) continue;
      const ViewPlace &one = from.places[source[k]], &other = to.places[k];
      pairs.Add(one.camera, one.u, one.v);
      pairs.Add(other.camera, other.u, other.v);
    }
  }
  return pairs;
}

}  // namespace regrade
