#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/background_spheres.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/splat_position.h"
#include "stylize/cuda/device_rows.h"
#include "stylize/cuda/warp_item.h"
#include "stylize/cuda/warp_row.h"
#include "stylize/field/view_penalty.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// Of a voxel, [-1, 1] across the box; or of a splat.
__device__ Vec3f BoxPosition(const StyleFieldView& grid, int64_t voxel) {
  if (grid.mean != nullptr) {
    const float* const mean = grid.mean + 3 * voxel;
    return SplatPosition(grid.frame, {mean[0], mean[1], mean[2]});
  }
  const Vec3i size = grid.frame.resolution;
  const int32_t vertex = grid.vertex_of_voxel[voxel];
  Vec3f place{0.5f, 0.5f, 0.5f};  // voxels from the box's corner
  place += Vec3i{vertex / (size.y * size.z), vertex / size.z % size.y, vertex % size.z}
               .Cast<float>();
  for (int a = 0; a < 3; ++a) place[a] = 2 * place[a] / static_cast<float>(size[a]) - 1;
  return place;
}

// A warp a point; see FillFeatures and FillTexelFeatures.
template <int kBasis>
__global__ void GatherRowsKernel(StyleFieldView grid, const int32_t* points, int64_t first,
                                 int64_t n, const int32_t* counted, float position_scale,
                                 float* rows) {
  using Row = WarpRow<kBasis>;
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const int64_t voxel = points != nullptr ? points[i] : first + i;
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part) {
    const int at = static_cast<int>(threadIdx.x & 31) + 32 * part;
    const int c = at / kBasis, k = at % kBasis, axis = at - Row::kSh;
    float value = 0;
    if (voxel >= grid.num_voxels) {
      const DeviceSpheresView& spheres = grid.spheres;
      const int64_t texel = voxel - grid.first_texel();
      if (at < Row::kSh && k == 0) {
        value = spheres.texels[4 * texel + c];
      } else if (axis >= 0 && axis < 3) {
        const int place = spheres.place_of_column[texel / spheres.layers];
        value = position_scale * TexelDirection<float>(spheres.resolution,
                                                       place / spheres.resolution,
                                                       place % spheres.resolution)[axis];
      }
    } else if (at < Row::kSh) {
      if (k < grid.basis) value = grid.records[voxel * grid.stride + c * grid.basis + k];
    } else if (axis < 3) {
      value = position_scale * BoxPosition(grid, voxel)[axis];
    }
    rows[i * Row::kStride + at] = value;
  }
}

template <int kBasis>
__global__ void AddMappedRowsKernel(Mat3f matrix, Vec3f constant, const float* from, int64_t n,
                                    const int32_t* counted, float* rows) {
  using Row = WarpRow<kBasis>;
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const float* row = from + i * Row::kStride;
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part) {
    const int at = static_cast<int>(threadIdx.x & 31) + 32 * part;
    if (at >= Row::kSh) return;
    const int c = at / kBasis, k = at % kBasis;
    float value = k == 0 ? constant[c] : 0.0f;
    for (int other = 0; other < 3; ++other)
      value += matrix.row[c][other] * row[other * kBasis + k];
    rows[i * Row::kStride + at] += value;
  }
}

template <int kBasis>
__global__ void AddViewPenaltyKernel(Mat3f matrix, const float* from, const float* rows,
                                     int64_t n, const int32_t* counted, float view_weight,
                                     float* d_rows, double* loss) {
  using Row = WarpRow<kBasis>;
  __shared__ float of_warp[kThreads / 32];
  const int lane = static_cast<int>(threadIdx.x & 31),
            warp = static_cast<int>(threadIdx.x / 32);
  const int64_t i = ItemOfWarp(n, counted);
  float penalty = 0;
  if (i >= 0) {
    float d[Row::kParts];
#pragma unroll
    for (int part = 0; part < Row::kParts; ++part)
      d[part] = d_rows[i * Row::kStride + lane + 32 * part];
#pragma unroll
    for (int part = 0; part < Row::kParts; ++part) {
      const int at = lane + 32 * part, c = at / kBasis, k = at % kBasis;
      const float mass =
          __shfl_sync(~0u, d[Row::kMass / 32], Row::kMass % 32 + (c < 3 ? c : 0));
      float sum = d[part];
      if (c < 3 && k > 0) {
        const float* row = from + i * Row::kStride;
        float change = rows[i * Row::kStride + at];
        for (int other = 0; other < 3; ++other)
          change -= matrix.row[c][other] * row[other * kBasis + k];
        const ViewPenalty<float> own = ViewPenaltyOf(mass, change);
        penalty += own.value;
        sum += view_weight * own.derivative;
      }
      d_rows[i * Row::kStride + at] = at < Row::kSh ? sum : 0.0f;
    }
  }
  for (int step = 16; step > 0; step /= 2) penalty += __shfl_down_sync(~0u, penalty, step);
  if (lane == 0) of_warp[warp] = penalty;
  __syncthreads();
  if (threadIdx.x > 0) return;
  double of_block = 0;
  for (int w = 0; w < kThreads / 32; ++w) of_block += double{of_warp[w]};
  if (of_block != 0) atomicAdd(loss, ExactTerm(double{view_weight} * of_block));
}

template <int kBasis>
__global__ void ScatterRowsKernel(const float* rows, int64_t first, int64_t n,
                                  StyleFieldView grid) {
  using Row = WarpRow<kBasis>;
  const int64_t i = ItemOfWarp(n, nullptr);
  if (i < 0) return;
  const int64_t voxel = first + i;
#pragma unroll
  for (int part = 0; part < Row::kParts; ++part) {
    const int at = static_cast<int>(threadIdx.x & 31) + 32 * part;
    if (at >= Row::kSh) return;
    const int c = at / kBasis, k = at % kBasis;
    const float value = rows[i * Row::kStride + at];
    if (voxel < grid.num_voxels) {
      if (k < grid.basis) grid.records[voxel * grid.stride + c * grid.basis + k] = value;
    } else if (k == 0) {
      grid.spheres.texels[4 * (voxel - grid.first_texel()) + c] = value;
    }
  }
}

}  // namespace

void GatherRows(const DeviceStyleField& field, const int32_t* points, int64_t first, int64_t n,
                float position_scale, float* rows, const int32_t* counted) {
  if (n == 0) return;
  ByRow(field.row(), [&](auto basis) {
    GatherRowsKernel<basis()><<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
        field.view(), points, first, n, counted, position_scale, rows);
  });
  CheckLaunch("gather_rows");
}

void AddMappedRows(const NetworkRow& row, const Mat3f& matrix, const Vec3f& constant,
                   const float* from, int64_t n, float* rows, const int32_t* counted) {
  if (n == 0) return;
  ByRow(row, [&](auto basis) {
    AddMappedRowsKernel<basis()><<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
        matrix, constant, from, n, counted, rows);
  });
  CheckLaunch("add_mapped_rows");
}

void AddViewPenalty(const NetworkRow& row, const Mat3f& matrix, const float* from,
                    const float* rows, int64_t n, float view_weight, float* d_rows,
                    double* loss, const int32_t* counted) {
  if (n == 0) return;
  ByRow(row, [&](auto basis) {
    AddViewPenaltyKernel<basis()><<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
        matrix, from, rows, n, counted, view_weight, d_rows, loss);
  });
  CheckLaunch("add_view_penalty");
}

void ScatterRows(const float* rows, int64_t first, int64_t n, DeviceStyleField* field) {
  if (n == 0) return;
  ByRow(field->row(), [&](auto basis) {
    ScatterRowsKernel<basis()>
        <<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(rows, first, n, field->view());
  });
  CheckLaunch("scatter_rows");
}

#else

void GatherRows(const DeviceStyleField&, const int32_t*, int64_t, int64_t, float, float*,
                const int32_t*) {
  DeviceWait("gather_rows");
}
void AddMappedRows(const NetworkRow&, const Mat3f&, const Vec3f&, const float*, int64_t, float*,
                   const int32_t*) {
  DeviceWait("add_mapped_rows");
}
void AddViewPenalty(const NetworkRow&, const Mat3f&, const float*, const float*, int64_t, float,
                    float*, double*, const int32_t*) {
  DeviceWait("add_view_penalty");
}
void ScatterRows(const float*, int64_t, int64_t, DeviceStyleField*) {
  DeviceWait("scatter_rows");
}

#endif

}  // namespace regrade
