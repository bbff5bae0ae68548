// The tree of an adaptive field's cells: changed, numbered and linked on the device. Every
// order is that of keys, so the result does not depend on the order in which threads run.
#include <vector>

#include "kernels/base/error.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cuda/device_cells.h"
#include "kernels/field/trilinear.h"

#if defined(__CUDACC__)
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>
#endif

namespace regrade {

CellsView DeviceCells::view(const Vec3i& voxels) const {
  return {{voxels.x >> finest, voxels.y >> finest, voxels.z >> finest},
          finest,
          level.data(),
          corner.data(),
          top.data(),
          nodes.data()};
}

DeviceCells UploadCells(const CellGrid& cells) {
  DeviceCells device;
  if (!cells.on()) return device;
  device.finest = cells.finest;
  device.key = DeviceBuffer<CellKey>::Of(cells.key, "keys of cells");
  device.level = DeviceBuffer<uint8_t>::Of(cells.level, "levels of cells");
  device.corner = DeviceBuffer<int32_t>::Of(cells.corner, "corners of cells");
  device.vertex_key = DeviceBuffer<CellKey>::Of(cells.vertex_key, "keys of vertices");
  device.top = DeviceBuffer<int32_t>::Of(cells.top, "top of a tree");
  device.nodes = DeviceBuffer<int32_t>::Of(cells.nodes, "nodes of a tree");
  return device;
}

CellGrid DownloadCells(const DeviceCells& device) {
  CellGrid cells;
  if (!device.on()) return cells;
  cells.finest = device.finest;
  cells.key = device.key.ToHost();
  cells.level = device.level.ToHost();
  cells.corner = device.corner.ToHost();
  cells.vertex_key = device.vertex_key.ToHost();
  cells.top = device.top.ToHost();
  cells.nodes = device.nodes.ToHost();
  return cells;
}

#if defined(__CUDACC__)

namespace {

__device__ int64_t Thread() {
  return blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
}

// Runs a cub function twice: for the size of its scratch memory, and for its result.
template <typename Function>
void WithScratch(const Function& function) {
  size_t bytes = 0;
  function(nullptr, &bytes);
  DeviceBuffer<uint8_t> scratch(static_cast<int64_t>(bytes), "scratch of a sort or scan");
  function(scratch.data(), &bytes);
}

// Position of `key` in keys in order, or -1.
__device__ int32_t Find(const CellKey* keys, int32_t n, CellKey key) {
  int32_t low = 0, high = n;
  while (low < high) {
    const int32_t middle = low + (high - low) / 2;
    if (keys[middle] < key)
      low = middle + 1;
    else
      high = middle;
  }
  return low < n && keys[low] == key ? low : -1;
}

__global__ void CountChildren(const uint8_t* change, const uint8_t* level, int finest,
                              int64_t n, int32_t* count) {
  const int64_t c = Thread();
  if (c >= n) return;
  const auto what = static_cast<CellChange>(change[c]);
  count[c] = what == CellChange::kRemove                       ? 0
             : what == CellChange::kSplit && level[c] < finest ? 8
                                                               : 1;
}

__global__ void PlaceChildren(const CellKey* key, const uint8_t* level, const int32_t* count,
                              const int32_t* first, int finest, int64_t n, CellKey* new_key,
                              uint8_t* new_level, int32_t* parent) {
  const int64_t c = Thread();
  if (c >= n) return;
  const int children = count[c], below = level[c] + (children == 8 ? 1 : 0);
  for (int k = 0; k < children; ++k) {
    const int64_t at = int64_t{first[c]} + k;
    new_key[at] = key[c] + (static_cast<CellKey>(k) << (3 * (finest - below)));
    new_level[at] = static_cast<uint8_t>(below);
    parent[at] = static_cast<int32_t>(c);
  }
}

__global__ void ListCorners(const CellKey* key, const uint8_t* level, int finest,
                            int64_t corners, CellKey* corner_key, int32_t* corner) {
  const int64_t i = Thread();
  if (i >= corners) return;
  corner_key[i] = KeyOf(
      CornerOf(PlaceOf(key[i / 8]), 1 << (finest - level[i / 8]), static_cast<int>(i % 8)));
  corner[i] = static_cast<int32_t>(i);
}

__global__ void MarkFirst(const CellKey* sorted, int64_t n, int32_t* mark) {
  const int64_t i = Thread();
  if (i < n) mark[i] = i == 0 || sorted[i] != sorted[i - 1] ? 1 : 0;
}

// `rank`: inclusive sums of MarkFirst's marks; `order`: corners in the order of their keys,
// ties in their own.
__global__ void NumberVertices(const CellKey* sorted, const int32_t* order, const int32_t* rank,
                               int64_t n, int32_t* corner, CellKey* vertex_key,
                               int32_t* first) {
  const int64_t i = Thread();
  if (i >= n) return;
  const int32_t vertex = rank[i] - 1;
  corner[order[i]] = vertex;
  if (i > 0 && sorted[i] == sorted[i - 1]) return;
  vertex_key[vertex] = sorted[i];
  first[vertex] = order[i];
}

__global__ void FindSources(const CellKey* vertex_key, const int32_t* first,
                            const int32_t* parent, int64_t n, const CellKey* old_key,
                            int32_t old_n, VertexSource* sources) {
  const int64_t v = Thread();
  if (v < n) sources[v] = {Find(old_key, old_n, vertex_key[v]), parent[first[v] / 8]};
}

// The ancestors of `level` of deeper cells; others get a mark that is left out.
__global__ void ListAncestors(const CellKey* key, const uint8_t* level, int64_t n, int finest,
                              int ancestor, CellKey* out, uint8_t* flag) {
  const int64_t c = Thread();
  if (c >= n) return;
  const CellKey mine = key[c] >> (3 * (finest - ancestor));
  out[c] = mine;
  flag[c] = level[c] > ancestor && (c == 0 || level[c - 1] <= ancestor ||
                                    key[c - 1] >> (3 * (finest - ancestor)) != mine);
}

struct Level {
  const CellKey* key = nullptr;  // of nodes, in order
  int32_t count = 0, first = 0;
};

__device__ int64_t TopIndex(const Vec3i& size, CellKey key) {
  const Vec3i at = PlaceOf(key);
  return (int64_t{at.x} * size.y + at.y) * size.z + at.z;
}

// Enters nodes of a level in their parents, or at the top of the tree.
__global__ void LinkNodes(Level mine, Level parents, bool at_top, Vec3i top_size, int32_t* top,
                          int32_t* nodes) {
  const int64_t i = Thread();
  if (i >= mine.count) return;
  const CellKey key = mine.key[i];
  const int32_t entry = EntryOfNode(mine.first + static_cast<int32_t>(i));
  if (at_top)
    top[TopIndex(top_size, key)] = entry;
  else
    nodes[8 * (int64_t{parents.first} + Find(parents.key, parents.count, key >> 3)) +
          static_cast<int64_t>(key & 7)] = entry;
}

__global__ void LinkCells(const CellKey* key, const uint8_t* level, int64_t n, int finest,
                          int at_level, Level parents, Vec3i top_size, int32_t* top,
                          int32_t* nodes) {
  const int64_t c = Thread();
  if (c >= n || level[c] != at_level) return;
  const CellKey mine = key[c] >> (3 * (finest - at_level));
  if (at_level == 0)
    top[TopIndex(top_size, mine)] = static_cast<int32_t>(c);
  else
    nodes[8 * (int64_t{parents.first} + Find(parents.key, parents.count, mine >> 3)) +
          static_cast<int64_t>(mine & 7)] = static_cast<int32_t>(c);
}

__global__ void FillEntries(int64_t n, int32_t* entries) {
  const int64_t i = Thread();
  if (i < n) entries[i] = kNoCell;
}

__global__ void MoveRows(const CellKey* from_key, const uint8_t* from_level,
                         const int32_t* from_corner, int finest, const CellKey* vertex_key,
                         const VertexSource* sources, int64_t n, const float* values, int lanes,
                         float factor, int64_t stride, float* out) {
  const int64_t v = Thread() / lanes;
  const int lane = static_cast<int>(Thread() % lanes);
  if (v >= n) return;
  const VertexSource source = sources[v];
  if (source.vertex >= 0) {
    out[v * stride + lane] = factor * values[int64_t{source.vertex} * lanes + lane];
    return;
  }
  const int64_t c = source.cell;
  const Vec3i offset = PlaceOf(vertex_key[v]) - PlaceOf(from_key[c]);
  const Vec3f fraction =
      offset.Cast<float>() / static_cast<float>(1 << (finest - from_level[c]));
  float sum = 0;
  for (int k = 0; k < 8; ++k)
    sum += CornerWeight(fraction, k) * values[int64_t{from_corner[8 * c + k]} * lanes + lane];
  out[v * stride + lane] = factor * sum;
}

template <typename T>
DeviceBuffer<T> FirstOf(const DeviceBuffer<T>& from, int64_t count, const char* what) {
  DeviceBuffer<T> result(count, what);
  if (count > 0) DeviceCopyWithin(result.data(), from.data(), count * int64_t{sizeof(T)});
  return result;
}

void NumberVerticesOf(const DeviceBuffer<int32_t>& parent, const DeviceCells& old,
                      DeviceCells* cells, DeviceBuffer<VertexSource>* sources) {
  const int64_t corners = 8 * cells->num_cells();
  REGRADE_CHECK(corners <= INT32_MAX);
  DeviceBuffer<CellKey> keys(corners, "keys of corners"), sorted(corners, "keys of corners");
  DeviceBuffer<int32_t> numbers(corners, "corners"), order(corners, "corners");
  ListCorners<<<BlocksFor(corners), kThreads>>>(cells->key.data(), cells->level.data(),
                                                cells->finest, corners, keys.data(),
                                                numbers.data());
  CheckLaunch("list_corners");
  WithScratch([&](void* scratch, size_t* bytes) {
    cub::DeviceRadixSort::SortPairs(scratch, *bytes, keys.data(), sorted.data(), numbers.data(),
                                    order.data(), corners, 0, 63);
  });
  keys = {};
  MarkFirst<<<BlocksFor(corners), kThreads>>>(sorted.data(), corners, numbers.data());
  CheckLaunch("mark_first");
  DeviceBuffer<int32_t> rank(corners, "numbers of vertices");
  WithScratch([&](void* scratch, size_t* bytes) {
    cub::DeviceScan::InclusiveSum(scratch, *bytes, numbers.data(), rank.data(), corners);
  });
  int32_t vertices = 0;
  DeviceCopyOut(&vertices, rank.data() + corners - 1, sizeof vertices);
  cells->corner = DeviceBuffer<int32_t>(corners, "corners of cells");
  cells->vertex_key = DeviceBuffer<CellKey>(vertices, "keys of vertices");
  DeviceBuffer<int32_t> first(vertices, "first corners of vertices");
  NumberVertices<<<BlocksFor(corners), kThreads>>>(sorted.data(), order.data(), rank.data(),
                                                   corners, cells->corner.data(),
                                                   cells->vertex_key.data(), first.data());
  CheckLaunch("number_vertices");
  *sources = DeviceBuffer<VertexSource>(vertices, "sources of vertices");
  FindSources<<<BlocksFor(vertices), kThreads>>>(
      cells->vertex_key.data(), first.data(), parent.data(), vertices, old.vertex_key.data(),
      static_cast<int32_t>(old.num_vertices()), sources->data());
  CheckLaunch("find_sources");
}

void LinkTree(const Vec3i& voxels, DeviceCells* cells) {
  const int64_t n = cells->num_cells();
  const Vec3i size = cells->view(voxels).top_size;
  std::vector<DeviceBuffer<CellKey>> keys;
  std::vector<Level> levels;
  int32_t total = 0;
  DeviceBuffer<CellKey> all(n, "ancestors of cells"), chosen(n, "ancestors of cells");
  DeviceBuffer<uint8_t> flags(n, "marks of ancestors");
  DeviceBuffer<int32_t> count(1, "number of ancestors");
  for (int level = 0; level < cells->finest; ++level) {
    ListAncestors<<<BlocksFor(n), kThreads>>>(cells->key.data(), cells->level.data(), n,
                                              cells->finest, level, all.data(), flags.data());
    CheckLaunch("list_ancestors");
    WithScratch([&](void* scratch, size_t* bytes) {
      cub::DeviceSelect::Flagged(scratch, *bytes, all.data(), flags.data(), chosen.data(),
                                 count.data(), n);
    });
    int32_t nodes = 0;
    count.CopyOut(&nodes, 1);
    keys.push_back(FirstOf(chosen, nodes, "keys of nodes"));
    levels.push_back({keys.back().data(), nodes, total});
    total += nodes;
  }
  const int64_t tops = int64_t{size.x} * size.y * size.z;
  cells->top = DeviceBuffer<int32_t>(tops, "top of a tree");
  cells->nodes = DeviceBuffer<int32_t>(8 * int64_t{total}, "nodes of a tree");
  FillEntries<<<BlocksFor(tops), kThreads>>>(tops, cells->top.data());
  if (total > 0)
    FillEntries<<<BlocksFor(8 * int64_t{total}), kThreads>>>(8 * int64_t{total},
                                                             cells->nodes.data());
  CheckLaunch("fill_entries");
  for (int level = 0; level <= cells->finest; ++level) {
    const Level parents = level > 0 ? levels[static_cast<size_t>(level) - 1] : Level{};
    if (level < cells->finest && levels[static_cast<size_t>(level)].count > 0)
      LinkNodes<<<BlocksFor(levels[static_cast<size_t>(level)].count), kThreads>>>(
          levels[static_cast<size_t>(level)], parents, level == 0, size, cells->top.data(),
          cells->nodes.data());
    LinkCells<<<BlocksFor(n), kThreads>>>(cells->key.data(), cells->level.data(), n,
                                          cells->finest, level, parents, size,
                                          cells->top.data(), cells->nodes.data());
    CheckLaunch("link_cells");
  }
  DeviceWait("the tree of cells");  // the keys of nodes are freed
}

}  // namespace

DeviceCells ChangeCellsOnDevice(const DeviceCells& old, const Vec3i& voxels,
                                const std::vector<CellChange>& change,
                                DeviceBuffer<VertexSource>* sources) {
  const int64_t n = old.num_cells();
  DeviceBuffer<uint8_t> what(n, "changes of cells");
  what.CopyIn(reinterpret_cast<const uint8_t*>(change.data()), n);
  DeviceBuffer<int32_t> count(n, "numbers of children"), first(n, "first children");
  CountChildren<<<BlocksFor(n), kThreads>>>(what.data(), old.level.data(), old.finest, n,
                                            count.data());
  CheckLaunch("count_children");
  WithScratch([&](void* scratch, size_t* bytes) {
    cub::DeviceScan::ExclusiveSum(scratch, *bytes, count.data(), first.data(), n);
  });
  int32_t last_first = 0, last_count = 0;
  DeviceCopyOut(&last_first, first.data() + n - 1, sizeof last_first);
  DeviceCopyOut(&last_count, count.data() + n - 1, sizeof last_count);
  const int64_t total = int64_t{last_first} + last_count;
  DeviceCells cells;
  cells.finest = old.finest;
  *sources = {};
  if (total == 0) return cells;
  cells.key = DeviceBuffer<CellKey>(total, "keys of cells");
  cells.level = DeviceBuffer<uint8_t>(total, "levels of cells");
  DeviceBuffer<int32_t> parent(total, "parents of cells");
  PlaceChildren<<<BlocksFor(n), kThreads>>>(old.key.data(), old.level.data(), count.data(),
                                            first.data(), old.finest, n, cells.key.data(),
                                            cells.level.data(), parent.data());
  CheckLaunch("place_children");
  NumberVerticesOf(parent, old, &cells, sources);
  LinkTree(voxels, &cells);
  return cells;
}

void MoveValuesOnDevice(const DeviceCells& from, const DeviceCells& to,
                        const DeviceBuffer<VertexSource>& sources, const float* values,
                        int lanes, float factor, int64_t stride, float* out) {
  MoveRows<<<BlocksFor(to.num_vertices() * lanes), kThreads>>>(
      from.key.data(), from.level.data(), from.corner.data(), from.finest, to.vertex_key.data(),
      sources.data(), to.num_vertices(), values, lanes, factor, stride, out);
  CheckLaunch("move_rows");
}

#else

DeviceCells ChangeCellsOnDevice(const DeviceCells&, const Vec3i&,
                                const std::vector<CellChange>&, DeviceBuffer<VertexSource>*) {
  DeviceWait("cells");
  return {};
}
void MoveValuesOnDevice(const DeviceCells&, const DeviceCells&,
                        const DeviceBuffer<VertexSource>&, const float*, int, float, int64_t,
                        float*) {
  DeviceWait("cells");
}

#endif

}  // namespace regrade
