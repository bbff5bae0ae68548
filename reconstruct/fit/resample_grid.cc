#include "reconstruct/fit/resample_grid.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <string>

#include "kernels/base/error.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

// Vertices of the old grid with at least the threshold weight, dilated by one in each
// direction.
std::vector<uint8_t> KeptVertices(const FastGrid& grid, const Buffer<float>& weights,
                                  float threshold) {
  const GridFrame& frame = grid.frame;
  const Vec3i n = frame.resolution;
  std::vector<uint8_t> keep(static_cast<size_t>(frame.NumVertices()));
  for (int64_t voxel = 0; voxel < grid.num_voxels(); ++voxel)
    if (weights[voxel] >= threshold) keep[static_cast<size_t>(grid.vertex_of_voxel[voxel])] = 1;
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<uint8_t> grown = keep;
    for (int64_t v = 0; v < frame.NumVertices(); ++v) {
      if (!keep[static_cast<size_t>(v)]) continue;
      const int64_t at = v / strides[axis] % n[axis];
      if (at > 0) grown[static_cast<size_t>(v - strides[axis])] = 1;
      if (at + 1 < n[axis]) grown[static_cast<size_t>(v + strides[axis])] = 1;
    }
    keep = std::move(grown);
  }
  return keep;
}

// With a margin of a cell's diagonal, as in svox2: includes all cells that the sphere cuts.
bool InsideBall(const GridFrame& frame, const Vec3f& p) {
  Vec3f q;
  for (int a = 0; a < 3; ++a) q[a] = (p[a] - frame.center[a]) / frame.radius[a];
  const int least = std::min({frame.resolution.x, frame.resolution.y, frame.resolution.z});
  return Norm(q) <= 1 + std::sqrt(3.0f) / static_cast<float>(least);
}

// Number of cameras that see a point beyond near_clip, up to `enough`. A vertex may project
// just outside of a photo and still be a corner of a visible cell.
int ViewsThatSee(const TrainingRays& rays, const Vec3d& p, float near_clip, int enough) {
  constexpr double kMargin = 0.02;  // of the photo's side
  int views = 0;
  for (int v = 0; v < rays.num_views() && views < enough; ++v) {
    const Camera& camera = rays.camera(v);
    const Vec3d point = camera.ndc.on() ? WorldFromNdc(camera.ndc, p) : p;
    double x, y;
    if (Norm(point - camera.Center()) < near_clip || !camera.Project(point, &x, &y)) continue;
    const double mx = kMargin * camera.width, my = kMargin * camera.height;
    views += x >= -mx && x <= camera.width + mx && y >= -my && y <= camera.height + my;
  }
  return views;
}

// `at` counts voxels from the box's corner.
Vec3d WorldOfLattice(const GridFrame& frame, const Vec3d& at) {
  Vec3d world;
  for (int a = 0; a < 3; ++a)
    world[a] = double{frame.center[a]} +
               (2 * at[a] / frame.resolution[a] - 1) * double{frame.radius[a]};
  return world;
}

}  // namespace

FastGrid MakeInitialGrid(const TrainingRays& rays, const GridFrame& frame, int basis,
                         float density, float near_clip, int min_views, bool ball) {
  FastGrid grid;
  grid.frame = frame;
  grid.basis = basis;
  grid.near_clip = near_clip;
  grid.background = rays.mean_color();
  const Vec3i n = frame.resolution;
  std::vector<uint8_t> seen(static_cast<size_t>(frame.NumVertices()));
#pragma omp parallel for schedule(dynamic, 1)
  for (int x = 0; x < n.x; ++x)
    for (int y = 0; y < n.y; ++y)
      for (int z = 0; z < n.z; ++z) {
        const Vec3d p =
            frame.WorldOf({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)})
                .Cast<double>();
        if (ball && !InsideBall(frame, p.Cast<float>())) continue;
        seen[static_cast<size_t>(frame.Vertex(x, y, z))] =
            ViewsThatSee(rays, p, near_clip, min_views) >= min_views;
      }
  grid.links.Resize(frame.NumVertices());
  int32_t count = 0;
  for (int64_t v = 0; v < frame.NumVertices(); ++v)
    grid.links[v] = seen[static_cast<size_t>(v)] ? count++ : -1;
  const int lanes = grid.lanes();
  grid.records.Resize(static_cast<int64_t>(count) * lanes);
  for (int64_t v = 0; v < count; ++v) grid.records[v * lanes + DensityLane(basis)] = density;
  RefreshDerived(&grid);
  return grid;
}

bool TwoViewsShareAPlace(const TrainingRays& rays, const GridFrame& frame, float near_clip) {
  constexpr int kMostPlaces = 32;  // a side
  Vec3i places;
  for (int a = 0; a < 3; ++a) places[a] = std::clamp(frame.resolution[a], 1, kMostPlaces);
  for (int x = 0; x <= places.x; ++x)
    for (int y = 0; y <= places.y; ++y)
      for (int z = 0; z <= places.z; ++z) {
        const Vec3d at{double(x) * frame.resolution.x / places.x,
                       double(y) * frame.resolution.y / places.y,
                       double(z) * frame.resolution.z / places.z};
        if (ViewsThatSee(rays, WorldOfLattice(frame, at), near_clip, 2) >= 2) return true;
      }
  return false;
}

Vec3i GridOfStage(const FitOptions& options, const SceneBox& box, size_t stage) {
  Vec3i n = ResolutionFor(box, options.resolutions[stage]);
  if (!options.resolutions_y.empty() || !options.resolutions_z.empty())
    n.x = options.resolutions[stage];
  if (!options.resolutions_y.empty()) n.y = options.resolutions_y[stage];
  if (!options.resolutions_z.empty()) n.z = options.resolutions_z[stage];
  return n;
}

float BoundedLimit(const Buffer<float>& weights, float least, int64_t most) {
  std::vector<float> kept;
  std::ranges::copy_if(weights, std::back_inserter(kept),
                       [least](float weight) { return weight >= least; });
  if (most == 0 || std::ssize(kept) <= most) return least;
  const auto last = kept.begin() + most - 1;
  std::ranges::nth_element(kept, last, std::greater());
  return *last;
}

Buffer<float> MaxWeightsOverViews(const FastGrid& grid, const TrainingRays& rays,
                                  const MarchOptions& options, int stride) {
  const int threads = omp_get_max_threads();
  std::vector<Buffer<float>> partial(static_cast<size_t>(threads));
  for (auto& buffer : partial) buffer.Resize(grid.num_voxels());
#pragma omp parallel for schedule(dynamic, 1)
  for (int view = 0; view < rays.num_views(); ++view) {
    const Camera& camera = rays.camera(view);
    std::vector<Ray> row;
    for (int y = 0; y < camera.height; y += stride) {
      row.clear();
      for (int x = 0; x < camera.width; x += stride) row.push_back(rays.RayOf(view, x, y));
      FastRays().max_weights(grid, row.data(), static_cast<int64_t>(row.size()), options,
                             partial[static_cast<size_t>(omp_get_thread_num())].data());
    }
  }
  Buffer<float> weights = std::move(partial[0]);
  for (int t = 1; t < threads; ++t)
    for (int64_t v = 0; v < weights.size(); ++v)
      weights[v] = std::max(weights[v], partial[static_cast<size_t>(t)][v]);
  return weights;
}

FastGrid Resample(const FastGrid& grid, const Buffer<float>& weights, float threshold,
                  const Vec3i& resolution) {
  const std::vector<uint8_t> keep = KeptVertices(grid, weights, threshold);
  FastGrid result;
  result.frame = grid.frame;
  result.frame.resolution = resolution;
  result.basis = grid.basis;
  result.background = grid.background;
  result.near_clip = grid.near_clip;
  const GridFrame& frame = result.frame;
  const int64_t vertices = frame.NumVertices();
  const Vec3f old_scale = grid.frame.Scale(), old_offset = grid.frame.Offset();
  // Position of a new vertex in the old grid. A vertex is kept if its nearest old vertex is.
  const auto old_position = [&](int64_t vertex) {
    const Vec3f at{
        static_cast<float>(vertex / (static_cast<int64_t>(resolution.y) * resolution.z)),
        static_cast<float>(vertex / resolution.z % resolution.y),
        static_cast<float>(vertex % resolution.z)};
    const Vec3f world = frame.WorldOf(at);
    Vec3f p;
    for (int a = 0; a < 3; ++a)
      p[a] = std::clamp(world[a] * old_scale[a] + old_offset[a], 0.0f,
                        static_cast<float>(grid.frame.resolution[a] - 1));
    return p;
  };
  result.links.Resize(vertices);
  int64_t count = 0;
  std::vector<int32_t> kept;
  for (int64_t v = 0; v < vertices; ++v) {
    const Vec3f p = old_position(v);
    const int64_t nearest = grid.frame.Vertex(static_cast<int>(std::lround(p.x)),
                                              static_cast<int>(std::lround(p.y)),
                                              static_cast<int>(std::lround(p.z)));
    const bool here = keep[static_cast<size_t>(nearest)] != 0;
    result.links[v] = here ? static_cast<int32_t>(count++) : -1;
    if (here) kept.push_back(static_cast<int32_t>(v));
  }
  if (count == 0)
    throw Error(ExitCode::kScene,
                "no voxel of the scene is left: none has a rendering weight above " +
                    std::to_string(threshold) + " in any view (largest " +
                    std::to_string(weights.empty()
                                       ? 0.0f
                                       : *std::max_element(weights.begin(), weights.end())) +
                    ")",
                "reconstruct", "check the poses, or lower prune-weight by --config");
  const int lanes = grid.lanes();
  result.records.Resize(count * lanes);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < count; ++i) {
    const Cell<float> cell = LocateCell(grid.frame, old_position(kept[static_cast<size_t>(i)]));
    Interpolate(grid.frame, grid.links.data(), grid.records.data(), lanes, lanes, cell,
                result.records.data() + i * lanes);
  }
  RefreshDerived(&result);
  return result;
}

}  // namespace regrade
