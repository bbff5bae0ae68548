#include "reconstruct/fit/measure_cells.h"

#include <omp.h>

#include <algorithm>
#include <cmath>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/render_cells.h"

namespace regrade {
namespace {

constexpr int kMostThreads = 4;  // each has arrays of all cells

// The statistics of some photos, and those of one photo for the widths.
struct Partial {
  Buffer<float> weight, widest, second, here;
  Buffer<uint64_t> error;

  explicit Partial(int64_t cells)
      : weight(cells), widest(cells), second(cells), here(cells), error(cells) {}

  void AddWidth(int64_t cell, float pixels) {
    if (pixels > widest[cell]) {
      second[cell] = widest[cell];
      widest[cell] = pixels;
    } else if (pixels > second[cell]) {
      second[cell] = pixels;
    }
  }
  void EndPhoto() {
    for (int64_t c = 0; c < here.size(); ++c) {
      if (here[c] > 0) AddWidth(c, here[c]);
      here[c] = 0;
    }
  }
};

void MeasurePhoto(const FastGrid& grid, const TrainingRays& rays, int view,
                  const MarchOptions& march, int stride, Partial* partial) {
  const Camera& camera = rays.camera(view);
  const CellsView cells = ViewOf(grid.cells(), grid.frame.resolution);
  std::vector<Ray> row, beside;
  std::vector<float> color, depth, transmittance;
  std::vector<CompositedCell<float>> samples;
  for (int y = 0; y < camera.height; y += stride) {
    row.clear();
    beside.clear();
    for (int x = 0; x < camera.width; x += stride) {
      row.push_back(rays.RayOf(view, x, y));
      beside.push_back(rays.RayOf(
          view, x + stride < camera.width ? x + stride : std::max(x - stride, 0), y));
    }
    color.resize(3 * row.size());
    depth.resize(row.size());
    transmittance.resize(row.size());
    FastRays().render(grid, row.data(), static_cast<int64_t>(row.size()), march, color.data(),
                      depth.data(), transmittance.data());
    for (size_t i = 0; i < row.size(); ++i) {
      const Vec3f seen{color[3 * i], color[3 * i + 1], color[3 * i + 2]};
      const Vec3f off = seen - rays.ColorOf(view, static_cast<int>(i) * stride, y);
      const float squares = Dot(off, off);
      MarchCells(grid.frame, cells, grid.vertex_density.data(), row[i], grid.near_clip,
                 march.stop_transmittance, &samples);
      for (const CompositedCell<float>& s : samples) {
        const int64_t c = s.place.cell;
        const float w = s.transmittance_before * Opacity(s.tau);
        partial->weight[c] = std::max(partial->weight[c], w);
        if (w < kSeenWeight) continue;
        if (std::isfinite(squares))
          partial->error[c] +=
              static_cast<uint64_t>(std::llrint(double{w * squares} / kErrorUnit));
        partial->here[c] = std::max(
            partial->here[c],
            WidthInPixels(grid.frame, row[i], beside[i], s.place.t, stride, s.place.width));
      }
    }
  }
  partial->EndPhoto();
}

}  // namespace

CellStatistics MeasureCells(const FastGrid& grid, const TrainingRays& rays,
                            const MarchOptions& march, int stride) {
  const int64_t n = grid.cells().num_cells();
  const int threads = std::min(omp_get_max_threads(), kMostThreads);
  std::vector<Partial> partials(static_cast<size_t>(threads), Partial(n));
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
  for (int view = 0; view < rays.num_views(); ++view)
    MeasurePhoto(grid, rays, view, march, stride,
                 &partials[static_cast<size_t>(omp_get_thread_num())]);
  Partial& all = partials[0];
  for (size_t p = 1; p < partials.size(); ++p)
    for (int64_t c = 0; c < n; ++c) {
      all.weight[c] = std::max(all.weight[c], partials[p].weight[c]);
      all.AddWidth(c, partials[p].widest[c]);
      all.AddWidth(c, partials[p].second[c]);
      all.error[c] += partials[p].error[c];
    }
  return {std::move(all.weight), std::move(all.second), std::move(all.error)};
}

std::vector<CellChange> ChooseChanges(const Buffer<uint8_t>& level,
                                      const CellStatistics& statistics,
                                      const CellLimits& limits) {
  const int64_t n = level.size();
  std::vector<CellChange> change(static_cast<size_t>(n), CellChange::kRemove);
  std::vector<int64_t> candidates;
  int64_t kept = 0;
  for (int64_t c = 0; c < n; ++c) {
    const float least =
        std::ldexp(limits.least_weight, std::min(0, limits.first_level - level[c]));
    if (!(statistics.weight[c] >= least)) continue;
    ++kept;
    change[static_cast<size_t>(c)] = CellChange::kKeep;
    if (level[c] < limits.deepest && statistics.pixels[c] > limits.least_pixels)
      candidates.push_back(c);
  }
  const int64_t room = limits.most_cells > 0
                           ? std::max<int64_t>(limits.most_cells - kept, 0) / 7
                           : static_cast<int64_t>(candidates.size());
  if (room < static_cast<int64_t>(candidates.size())) {
    const auto more_error = [&](int64_t a, int64_t b) {
      return statistics.error[a] != statistics.error[b]
                 ? statistics.error[a] > statistics.error[b]
                 : a < b;
    };
    std::nth_element(candidates.begin(), candidates.begin() + room, candidates.end(),
                     more_error);
    candidates.resize(static_cast<size_t>(room));
  }
  for (const int64_t c : candidates) change[static_cast<size_t>(c)] = CellChange::kSplit;
  return change;
}

void ApplyChanges(const std::vector<CellChange>& change, FastGrid* grid,
                  Buffer<float>* second_moment) {
  std::vector<VertexSource> sources;
  CellGrid cells = ChangeCells(grid->cells(), grid->frame.resolution, change, &sources);
  const auto move = [&](Buffer<float>* values, int lanes) {
    if (values->size() == 0) return;
    Buffer<float> moved(cells.num_vertices() * lanes);
    MoveValues(grid->cells(), cells, sources, values->data(), lanes, moved.data());
    *values = std::move(moved);
  };
  move(&grid->records, grid->lanes());
  move(second_moment, grid->lanes());
  for (float& moment : *second_moment) moment *= kMomentOfChildren;
  move(&grid->density_rate, 1);
  grid->SetCells(std::move(cells));
  RefreshDerived(grid);
}

}  // namespace regrade
