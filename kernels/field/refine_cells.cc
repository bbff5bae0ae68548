#include "kernels/field/refine_cells.h"

#include <algorithm>

#include "kernels/field/trilinear.h"

namespace regrade {

CellGrid ChangeCells(const CellGrid& old, const Vec3i& voxels,
                     const std::vector<CellChange>& change,
                     std::vector<VertexSource>* sources) {
  CellGrid grid;
  grid.finest = old.finest;
  const auto children = [&](int64_t c) {
    const CellChange what = change[static_cast<size_t>(c)];
    return what == CellChange::kRemove                               ? 0
           : what == CellChange::kSplit && old.level[c] < old.finest ? 8
                                                                     : 1;
  };
  int64_t count = 0;
  for (int64_t c = 0; c < old.num_cells(); ++c) count += children(c);
  grid.key = Buffer<CellKey>(count);
  grid.level = Buffer<uint8_t>(count);
  std::vector<int32_t> parent(static_cast<size_t>(count));
  int64_t next = 0;
  for (int64_t c = 0; c < old.num_cells(); ++c) {
    const int n = children(c), level = old.level[c] + (n == 8);
    for (int child = 0; child < n; ++child, ++next) {
      grid.key[next] = old.key[c] + (static_cast<CellKey>(child) << (3 * (old.finest - level)));
      grid.level[next] = static_cast<uint8_t>(level);
      parent[static_cast<size_t>(next)] = static_cast<int32_t>(c);
    }
  }
  FindVertices(&grid);
  BuildTree(voxels, &grid);
  sources->assign(static_cast<size_t>(grid.num_vertices()), {});
  for (int64_t i = 8 * count; i-- > 0;)  // the first cell is written last
    (*sources)[static_cast<size_t>(grid.corner[i])].cell = parent[static_cast<size_t>(i / 8)];
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < grid.num_vertices(); ++v)
    (*sources)[static_cast<size_t>(v)].vertex =
        static_cast<int32_t>(FindKey(old.vertex_key, grid.vertex_key[v]));
  return grid;
}

void MoveValues(const CellGrid& from, const CellGrid& to,
                const std::vector<VertexSource>& sources, const float* values, int lanes,
                float* out) {
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < to.num_vertices(); ++v) {
    const VertexSource& source = sources[static_cast<size_t>(v)];
    float* const record = out + v * lanes;
    if (source.vertex >= 0) {
      std::copy_n(values + int64_t{source.vertex} * lanes, lanes, record);
      continue;
    }
    const int64_t c = source.cell;
    const float width = static_cast<float>(1 << (from.finest - from.level[c]));
    const Vec3i offset = PlaceOf(to.vertex_key[v]) - PlaceOf(from.key[c]);
    const Vec3f fraction = offset.Cast<float>() / width;
    std::fill_n(record, lanes, 0.0f);
    for (int k = 0; k < 8; ++k) {
      const float w = CornerWeight(fraction, k);
      const float* const corner = values + int64_t{from.corner[8 * c + k]} * lanes;
      for (int i = 0; i < lanes; ++i) record[i] += w * corner[i];
    }
  }
}

}  // namespace regrade
