// What the device keeps of a splat that a camera sees, and the tiles that its ellipse meets.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/extent.h"

namespace regrade {

inline constexpr int kDeviceTile = 8;  // pixels, both sides
inline constexpr int kTilePixels = kDeviceTile * kDeviceTile;

// As SeenSplat, in 48 bytes.
struct alignas(16) SplatRecord {
  double u = 0, v = 0;
  float c00 = 1, c10 = 0, c11 = 1, log_opacity = 0;
  Vec3f color;
  float z = 0;
};

struct TileGrid {
  int width = 0, height = 0;  // pixels
  int columns = 0, rows = 0;  // tiles
  TileGrid() = default;
  TileGrid(int width, int height)
      : width(width),
        height(height),
        columns((width + kDeviceTile - 1) / kDeviceTile),
        rows((height + kDeviceTile - 1) / kDeviceTile) {}
  HD int count() const { return columns * rows; }
};

#if defined(__CUDACC__)

// Columns of tiles in a row of tiles.
struct TileSpan {
  int begin = 0, end = 0;
};

// The tiles of which some pixel's centre is in the ellipse q <= Q, row by row: the part of an
// ellipse between two horizontal lines is widest at its own rightmost and leftmost points or
// on a line. With the offset (d_x, d_y) = (c00 w_0, c10 w_0 + c11 w_1), |w| <= R = sqrt(Q) and
// L^2 = c10^2 + c11^2, the line d_y = L t has w_0 = (c10 / L) t +- (c11 / L) sqrt(R^2 - t^2),
// and the extreme points +-c00 R are at t = +-R c10 / L.
//
// Wider than the ellipse by some roundings, and never narrower: a tile too many does no harm.
// All arithmetic is of single operations, which compilers do not merge: every kernel finds the
// same tiles.
class SplatTiles {
 public:
  __device__ SplatTiles(const SplatRecord& r, const TileGrid& grid) : columns_(grid.columns) {
    u_ = static_cast<float>(r.u);
    v_ = static_cast<float>(r.v);
    c00_ = r.c00;
    const float square = __fmul_rn(2, __fsub_rn(r.log_opacity, float(kLogMinAlpha)));
    radius_ = __fadd_rn(__fmul_rn(FastRoot(fmaxf(square, 0)), 1 + float(kExtentMargin)),
                        float(kExtentMargin));
    const float most = fmaxf(fabsf(r.c10), r.c11);
    const float scale = FastReciprocal(most);
    const float s0 = __fmul_rn(r.c10, scale), s1 = __fmul_rn(r.c11, scale);
    const float length = __fmul_rn(most, FastRoot(__fmaf_rn(s0, s0, __fmul_rn(s1, s1))));
    inverse_ = FastReciprocal(length);
    k0_ = __fmul_rn(r.c10, inverse_);
    k1_ = __fmul_rn(r.c11, inverse_);
    const float high = __fmul_rn(length, radius_), wide = __fmul_rn(r.c00, radius_);
    margin_y_ = __fmaf_rn(high, kRounding, kMargin);
    margin_x_ = __fmaf_rn(wide, kRounding, kMargin);
    Limit(__fsub_rn(v_, __fadd_rn(high, margin_y_)), __fadd_rn(v_, __fadd_rn(high, margin_y_)),
          grid.rows, &first_row_, &end_row_);
    // Bounds of all rows, for those who count tiles.
    Limit(__fsub_rn(u_, __fadd_rn(wide, margin_x_)), __fadd_rn(u_, __fadd_rn(wide, margin_x_)),
          grid.columns, &first_column_, &end_column_);
    if (first_column_ >= end_column_) end_row_ = first_row_;
  }

  __device__ int first_row() const { return first_row_; }
  __device__ int end_row() const { return end_row_; }

  __device__ TileSpan Row(int row) const {
    const float top = __fsub_rn(static_cast<float>(row * kDeviceTile) + 0.5f, v_);
    float low = __fmul_rn(__fsub_rn(top, margin_y_), inverse_);
    float high = __fmul_rn(__fadd_rn(top, __fadd_rn(kDeviceTile - 1, margin_y_)), inverse_);
    TileSpan span;
    if (!(low <= radius_) || !(high >= -radius_)) return span;
    const float extreme = __fmul_rn(k0_, radius_);
    const float right = Side(extreme, low, high, 1), left = Side(-extreme, low, high, -1);
    Limit(__fsub_rn(__fmaf_rn(c00_, left, u_), margin_x_),
          __fadd_rn(__fmaf_rn(c00_, right, u_), margin_x_), columns_, &span.begin, &span.end);
    if (span.end < span.begin) span.end = span.begin;
    return span;
  }

  __device__ int Count() const {
    int count = 0;
    for (int row = first_row_; row < end_row_; ++row) {
      const TileSpan span = Row(row);
      count += span.end - span.begin;
    }
    return count;
  }

  // Calls visit(tile, place) for all tiles by one thread.
  template <typename Visit>
  __device__ void ForAll(const Visit& visit) const {
    int place = 0;
    for (int row = first_row_; row < end_row_; ++row) {
      const TileSpan span = Row(row);
      for (int column = span.begin; column < span.end; ++column)
        visit(row * columns_ + column, place++);
    }
  }

  // The same by all threads of a warp, each of which visits rows.
  template <typename Visit>
  __device__ void ForAllByWarp(const Visit& visit) const {
    const int lane = static_cast<int>(threadIdx.x % 32);
    int before = 0;
    for (int first = first_row_; first < end_row_; first += 32) {
      const int row = first + lane;
      const TileSpan span = row < end_row_ ? Row(row) : TileSpan();
      const int width = span.end - span.begin;
      int sum = width;
      for (int step = 1; step < 32; step *= 2) {
        const int other = __shfl_up_sync(kWholeWarp, sum, step);
        if (lane >= step) sum += other;
      }
      int place = before + sum - width;
      for (int column = span.begin; column < span.end; ++column)
        visit(row * columns_ + column, place++);
      before += __shfl_sync(kWholeWarp, sum, 31);
    }
  }

 private:
  static constexpr float kMargin = 1.0f / 64, kRounding = 4e-6f;  // pixels; relative

  // Tiles of `count` of which a pixel's centre is within [low, high].
  static __device__ void Limit(float low, float high, int count, int* begin, int* end) {
    const float first =
        ceilf(__fmul_rn(__fsub_rn(low, kDeviceTile - 0.5f), 1.0f / kDeviceTile));
    const float last = floorf(__fmul_rn(__fsub_rn(high, 0.5f), 1.0f / kDeviceTile));
    const float most = static_cast<float>(count);
    *begin = static_cast<int>(fminf(fmaxf(first, 0), most));
    *end = static_cast<int>(fminf(fmaxf(__fadd_rn(last, 1), 0), most));
  }

  // The greatest w_0 (sign 1) or the least (-1) with t in [low, high]; `extreme`: t of the
  // whole ellipse's.
  __device__ float Side(float extreme, float low, float high, float sign) const {
    const float t = fminf(fmaxf(fminf(fmaxf(extreme, low), high), -radius_), radius_);
    if (t == extreme) return __fmul_rn(sign, radius_);
    const float half =
        FastRoot(fmaxf(__fsub_rn(__fmul_rn(radius_, radius_), __fmul_rn(t, t)), 0));
    return __fmaf_rn(k0_, t, __fmul_rn(sign, __fmul_rn(k1_, half)));
  }

  float u_, v_, c00_, radius_, inverse_, k0_, k1_, margin_x_, margin_y_;
  int columns_, first_row_, end_row_, first_column_, end_column_;
};

#endif

}  // namespace regrade
