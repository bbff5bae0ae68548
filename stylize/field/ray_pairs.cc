#include "stylize/field/ray_pairs.h"

#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"

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

// Depth along the optical axis of what a ray of the camera meets; 0 where it meets nothing.
double DepthOf(const FieldView<float>& field, const Camera& camera, const Ray& ray,
               const MarchOptions& march) {
  const RayResult<float> result = RenderRay(field, ray, march);
  Vec3f color = result.color;
  float depth = result.depth;
  ResolvePixel{camera}(ray, result.transmittance, &color, &depth);
  return depth;
}

std::optional<RayPair> PairOfOnePoint(const FieldView<float>& field, const Camera& from,
                                      const Camera& to, int x, int y,
                                      const MarchOptions& march) {
  const Ray ray = from.PixelRay(x, y);
  const double depth = DepthOf(field, from, ray, march);
  if (!(depth > 0)) return std::nullopt;
  const RayT<double> world = from.WorldRay(x + 0.5, y + 0.5);
  const Vec3d point =
      world.origin + world.direction * (depth / Dot(world.direction, from.Forward()));
  double u, v, expected;
  if (!to.Project(point, &u, &v, &expected)) return std::nullopt;
  if (!(u >= 0.5 && u <= to.width - 0.5 && v >= 0.5 && v <= to.height - 0.5))
    return std::nullopt;
  const Ray other = to.FieldRay(u, v);
  const double seen = DepthOf(field, to, other, march);
  if (!(std::abs(seen / expected - 1) <= kDepthTolerance)) return std::nullopt;
  return RayPair{ray, other};
}

}  // namespace

std::vector<RayPair> NeighbouringPixels(const std::vector<Camera>& cameras, int64_t count,
                                        uint64_t seed) {
  REGRADE_CHECK(!cameras.empty());
  std::vector<RayPair> pairs;
  for (int64_t i = 0; i < count; ++i) {
    const Draw draw{seed, kNeighbourStream, i};
    const Camera& camera = cameras[draw(0, static_cast<int>(cameras.size()))];
    const bool down = draw(1, 2) == 1;
    const int right = down ? 0 : 1, below = down ? 1 : 0;
    if (camera.width <= right || camera.height <= below) continue;
    const int x = draw(2, camera.width - right), y = draw(3, camera.height - below);
    pairs.emplace_back(camera.PixelRay(x, y), camera.PixelRay(x + right, y + below));
  }
  return pairs;
}

std::vector<RayPair> PixelsOfOnePoint(const RadianceField& field,
                                      const std::vector<Camera>& cameras, int64_t count,
                                      uint64_t seed, const MarchOptions& march) {
  if (cameras.size() < 2) return {};
  const FieldView<float> view = ViewOf(field);
  std::vector<RayPair> pairs;
  for (int round = 0; round < kTries && std::ssize(pairs) < count; ++round) {
    std::vector<std::optional<RayPair>> found(static_cast<size_t>(count));
#pragma omp parallel for schedule(dynamic, 16)
    for (int64_t i = 0; i < count; ++i) {
      const Draw draw{seed, kPointStream, round * count + i};
      const int from = draw(0, static_cast<int>(cameras.size()));
      const size_t to = (static_cast<size_t>(from) + 1) % cameras.size();
      const Camera& camera = cameras[static_cast<size_t>(from)];
      const int x = draw(1, camera.width), y = draw(2, camera.height);
      found[static_cast<size_t>(i)] = PairOfOnePoint(view, camera, cameras[to], x, y, march);
    }
    for (const std::optional<RayPair>& pair : found)
      if (pair && std::ssize(pairs) < count) pairs.push_back(*pair);
  }
  return pairs;
}

}  // namespace regrade
