// What a network that restyles a field reads and writes of it on a CUDA device: a row a point
// (see DeviceGridView), or a splat.
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"
#include "stylize/cuda/device_style_field.h"

namespace regrade {

// Rows are as RowOf(basis of the field) says, [n, stride].

// Coefficients, the place of the voxel in the box or the texel's direction times position_scale
// (see FillFeatures and FillTexelFeatures in stylize/field/lipschitz_network.h), zeros. points
// [n], or null for first, first + 1, ... `counted`, here and below, lies on the device: if it
// is not null, n is no more than room, and *counted of the rows are meant.
void GatherRows(const DeviceStyleField& field, const int32_t* points, int64_t first, int64_t n,
                float position_scale, float* rows, const int32_t* counted = nullptr);
// rows += (matrix (x) I_B) from, and `constant` on each channel's first coefficient.
void AddMappedRows(const NetworkRow& row, const Mat3f& matrix, const Vec3f& constant,
                   const float* from, int64_t n, float* rows, const int32_t* counted = nullptr);
// Behind BlendColorsAdjoint, see EQ(view-penalty): the gradient of view_weight times it,
// without its 1 / (3 Q), is added to d_rows, whose masses are cleared, and the penalty to *loss
// on the device. `rows` are the map's and the network's of `from`.
void AddViewPenalty(const NetworkRow& row, const Mat3f& matrix, const float* from,
                    const float* rows, int64_t n, float view_weight, float* d_rows,
                    double* loss, const int32_t* counted = nullptr);
// The field's own colours from rows of points first, first + 1, ...
void ScatterRows(const float* rows, int64_t first, int64_t n, DeviceStyleField* field);

}  // namespace regrade
