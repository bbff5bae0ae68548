#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cuda/cell_march.h"
#include "kernels/field/cuda/device_cell_statistics.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// Of the photos so far, and the widths in the one that is measured.
struct Sums {
  float *weight, *widest, *second, *here;
  unsigned long long* error;
};

// Positive floats are ordered like their bits.
__device__ void RaiseTo(float* target, float value) {
  if (*target < value) atomicMax(reinterpret_cast<int*>(target), __float_as_int(value));
}

// `rays` are of a photo's rows of `columns`; first: the ray of the first list.
__global__ void AddRays(GridFrame frame, CellsView cells, const Ray* rays, const Vec3f* colors,
                        const Vec3f* targets, int64_t first, int64_t n, int columns, int stride,
                        CellSamples lists, Sums sums) {
  const int64_t list = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (list >= n) return;
  const int64_t r = first + list;
  const int column = static_cast<int>(r % columns);
  const Ray ray = rays[r];
  const Ray beside = rays[column + 1 < columns ? r + 1 : column > 0 ? r - 1 : r];
  const Vec3f off = colors[r] - targets[r];
  const float squares = Dot(off, off);
  const int64_t begin = list * lists.capacity;
  for (int i = 0; i < lists.count[list]; ++i) {
    const int cell = __float_as_int(lists.place[4 * (begin + i)]) / 8;
    const float* const rest = lists.rest + 4 * (begin + i);
    const float w = rest[0] * Opacity(lists.raw_tau[4 * (begin + i) + 3]);
    RaiseTo(sums.weight + cell, w);
    if (w < kSeenWeight) continue;
    if (isfinite(squares))
      atomicAdd(sums.error + cell,
                static_cast<unsigned long long>(llrint(double{w * squares} / kErrorUnit)));
    RaiseTo(sums.here + cell, WidthInPixels(frame, ray, beside, rest[2], stride,
                                            1 << (cells.finest - cells.level[cell])));
  }
}

__global__ void EndPhoto(Sums sums, int64_t n) {
  const int64_t c = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (c >= n) return;
  const float pixels = sums.here[c];
  sums.here[c] = 0;
  if (pixels > sums.widest[c]) {
    sums.second[c] = sums.widest[c];
    sums.widest[c] = pixels;
  } else if (pixels > sums.second[c]) {
    sums.second[c] = pixels;
  }
}

}  // namespace

CellStatistics MeasureCellsOnDevice(const DeviceGrid& grid, const DeviceViews& views,
                                    const MarchOptions& march, int stride) {
  const int64_t n = grid.cells.num_cells();
  DeviceBuffer<float> arrays(4 * n, "statistics of cells");
  DeviceBuffer<uint64_t> error(n, "errors of cells");
  arrays.Zero();
  error.Zero();
  const Sums sums{arrays.data(), arrays.data() + n, arrays.data() + 2 * n,
                  arrays.data() + 3 * n, reinterpret_cast<unsigned long long*>(error.data())};
  int64_t most = 1;
  for (int view = 0; view < views.num_views(); ++view)
    most = std::max(most, views.RaysOf(view, stride, nullptr));
  DeviceBuffer<Ray> rays(most, "rays of a photo");
  DeviceBuffer<Vec3f> colors(most, "colours of a view"), targets(most, "colours of a photo");
  DeviceBuffer<float> depths(most, "depths of a view"),
      transmittances(most, "transmittances of a view");
  CellSampleStore store(grid.frame, std::min<int64_t>(most, 1 << 16), int64_t{1} << 30);
  const CellSamples lists = store.view();
  for (int view = 0; view < views.num_views(); ++view) {
    const int64_t size = views.RaysOf(view, stride, rays.data());
    views.TargetsOf(view, stride, targets.data());
    RenderOnDevice(grid, rays.data(), size, march,
                   {colors.data(), depths.data(), transmittances.data()});
    const int columns = (views.WidthOf(view) + stride - 1) / stride;
    for (int64_t begin = 0; begin < size; begin += store.rays()) {
      const int64_t part = std::min(size - begin, store.rays());
      MarchCellsOnDevice(grid, rays.data() + begin, part, march, lists);
      AddRays<<<BlocksFor(part), kThreads>>>(grid.frame, grid.view().cells, rays.data(),
                                             colors.data(), targets.data(), begin, part,
                                             columns, stride, lists, sums);
      CheckLaunch("add_rays");
    }
    EndPhoto<<<BlocksFor(n), kThreads>>>(sums, n);
    CheckLaunch("end_photo");
  }
  CellStatistics result{Buffer<float>(n), Buffer<float>(n), error.ToHost()};
  DeviceCopyOut(result.weight.data(), sums.weight, n * int64_t{sizeof(float)});
  DeviceCopyOut(result.pixels.data(), sums.second, n * int64_t{sizeof(float)});
  return result;
}

#else

CellStatistics MeasureCellsOnDevice(const DeviceGrid&, const DeviceViews&, const MarchOptions&,
                                    int) {
  DeviceWait("statistics of cells");
  return {};
}

#endif

}  // namespace regrade
