#include "reconstruct/fit/initial_cells.h"

#include <algorithm>
#include <vector>

namespace regrade {
namespace {

// Number of cameras that see a point beyond near_clip, up to `enough`. A vertex may project
// just outside of a photo and still be a corner of a visible cell: `margin` is a fraction of
// the photo's side.
int ViewsThatSee(const TrainingRays& rays, const Vec3d& p, float near_clip, double margin,
                 int enough) {
  int views = 0;
  for (int v = 0; v < rays.num_views() && views < enough; ++v) {
    const Camera& camera = rays.camera(v);
    const Vec3d point = camera.ndc.on() ? WorldFromNdc(camera.ndc, p) : p;
    double x, y;
    if (Norm(point - camera.Center()) < near_clip || !camera.Project(point, &x, &y)) continue;
    const double mx = margin * camera.width, my = margin * camera.height;
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

bool TouchesBall(const GridFrame& frame, const Vec3i& low, int width) {
  double distance = 0;  // of the cell's nearest point from the centre, in half sides
  for (int a = 0; a < 3; ++a) {
    const double begin = 2.0 * low[a] / frame.resolution[a] - 1;
    const double end = 2.0 * (low[a] + width) / frame.resolution[a] - 1;
    const double nearest = begin > 0 ? begin : end < 0 ? -end : 0;
    distance += nearest * nearest;
  }
  return distance <= 1;
}

struct FirstCell {
  CellKey key;
  uint8_t level;
};

// Whether a cell reaches into the box, which is 2^outward times smaller than the frame.
bool ReachesIntoBox(const GridFrame& frame, const Vec3i& low, int width, int outward) {
  for (int a = 0; a < 3; ++a) {
    const int middle = frame.resolution[a] / 2, half = middle >> outward;
    if (low[a] >= middle + half || low[a] + width <= middle - half) return false;
  }
  return true;
}

// Calls keep(low, level) for the first cells in a cell.
template <typename Keep>
void ForFirstCells(const GridFrame& frame, const CellLevels& levels, const Vec3i& low,
                   int level, const Keep& keep) {
  const int width = 1 << (levels.all() - level);
  if (level == levels.outward || !ReachesIntoBox(frame, low, width, levels.outward)) {
    keep(low, level);
    return;
  }
  for (int child = 0; child < 8; ++child)
    ForFirstCells(frame, levels, CornerOf(low, width / 2, child), level + 1, keep);
}

}  // namespace

GridFrame CellFrame(const SceneBox& box, int coarsest, const CellLevels& levels) {
  const int finest = levels.finest;
  Vec3i size = ResolutionFor(box, coarsest << finest);
  for (int a = 0; a < 3; ++a)
    size[a] = std::max(1, ((size[a] >> finest) + (size[a] >> (finest - 1) & (finest > 0))))
              << finest;
  // In device coordinates rays run along z, and what is seen of a surface lies across.
  constexpr int kWidthsPerLayer = 3;
  if (box.layers > 0) size.z = std::max(1, coarsest / kWidthsPerLayer) << finest;
  const int times = 1 << levels.outward;
  return {size * times, box.center, box.radius * static_cast<float>(times)};
}

FastGrid MakeInitialCells(const TrainingRays& rays, const GridFrame& frame,
                          const CellLevels& levels, int basis, float density, float near_clip,
                          int min_views, bool ball) {
  FastGrid grid;
  grid.frame = frame;
  grid.basis = basis;
  grid.near_clip = near_clip;
  grid.background = rays.mean_color();
  const int width = 1 << levels.all();
  const Vec3i top{frame.resolution.x / width, frame.resolution.y / width,
                  frame.resolution.z / width};
  std::vector<std::vector<FirstCell>> rows(static_cast<size_t>(top.x));
  const auto seen = [&](const Vec3d& at) {
    return ViewsThatSee(rays, WorldOfLattice(frame, at), near_clip, 0.02, min_views) >=
           min_views;
  };
#pragma omp parallel for schedule(dynamic, 1)
  for (int x = 0; x < top.x; ++x) {
    const auto keep_seen = [&](const Vec3i& low, int level) {
      const int own = 1 << (levels.all() - level);
      if (ball && !TouchesBall(frame, low, own)) return;
      bool kept = seen(low.Cast<double>() + Vec3d{0.5, 0.5, 0.5} * static_cast<double>(own));
      for (int k = 0; k < 8 && !kept; ++k) kept = seen(CornerOf(low, own, k).Cast<double>());
      if (kept)
        rows[static_cast<size_t>(x)].push_back({KeyOf(low), static_cast<uint8_t>(level)});
    };
    for (int y = 0; y < top.y; ++y)
      for (int z = 0; z < top.z; ++z)
        ForFirstCells(frame, levels, {x * width, y * width, z * width}, 0, keep_seen);
  }
  std::vector<FirstCell> first;
  for (const auto& row : rows) first.insert(first.end(), row.begin(), row.end());
  std::ranges::sort(first, {}, &FirstCell::key);
  CellGrid cells;
  cells.finest = levels.all();
  cells.key = Buffer<CellKey>(static_cast<int64_t>(first.size()));
  cells.level = Buffer<uint8_t>(cells.key.size());
  for (size_t i = 0; i < first.size(); ++i) {
    cells.key[static_cast<int64_t>(i)] = first[i].key;
    cells.level[static_cast<int64_t>(i)] = first[i].level;
  }
  FindVertices(&cells);
  BuildTree(frame.resolution, &cells);
  grid.SetCells(std::move(cells));
  const int lanes = grid.lanes();
  grid.records.Resize(grid.cells().num_vertices() * lanes);
  for (int64_t v = 0; v < grid.num_voxels(); ++v)
    grid.records[v * lanes + DensityLane(basis)] = density;
  grid.density_rate = DensityRates(rays, frame, grid.cells(), near_clip);
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
        if (ViewsThatSee(rays, WorldOfLattice(frame, at), near_clip, 0.02, 2) >= 2) return true;
      }
  return false;
}

Buffer<float> DensityRates(const TrainingRays& rays, const GridFrame& frame,
                           const CellGrid& cells, float near_clip) {
  Buffer<float> rates(cells.num_vertices());
  float most = 1;  // photos
#pragma omp parallel for schedule(dynamic, 256) reduction(max : most)
  for (int64_t v = 0; v < rates.size(); ++v) {
    const Vec3d at = WorldOfLattice(frame, PlaceOf(cells.vertex_key[v]).Cast<double>());
    rates[v] = static_cast<float>(ViewsThatSee(rays, at, near_clip, 0, rays.num_views()));
    most = std::max(most, rates[v]);
  }
  constexpr float kLeast = 1e-3f;
  for (float& rate : rates) rate = std::max(kLeast, rate / most);
  return rates;
}

}  // namespace regrade
