// A layer of the narrow network, and its adjoint, for the 16 rows of a warp. Device code only.
#pragma once

#include "kernels/network/cuda/tensor_tile.h"
#include "kernels/network/fused_mlp.h"

#if defined(__CUDACC__)

namespace regrade {

inline constexpr int kRows = 16;                     // a warp's tile
inline constexpr int kHiddenTiles = kMlpHidden / 8;  // columns of a tile are 8
inline constexpr int kPad = 8;  // floats after a row of weights: avoids bank conflicts

// Of a network whose ends are kEnds wide.
template <int kEnds>
struct MlpView {
  const float* parameters;  // in the layout of FusedMlp::Offset
  int layers;
  Activation activation;
  float omega;

  __host__ __device__ int Inputs(int l) const { return l == 0 ? kEnds : kMlpHidden; }
  __host__ __device__ int Outputs(int l) const { return l + 1 == layers ? kEnds : kMlpHidden; }
  __host__ __device__ int Offset(int l) const {
    int offset = 0;
    for (int i = 0; i < l; ++i) offset += Outputs(i) * (Inputs(i) + 1);
    return offset;
  }
};

// Weights in shared memory, or in global memory if they do not fit.
template <int kEnds>
class Weights {
 public:
  __device__ Weights(const MlpView<kEnds>& mlp, float* shared) : mlp_(mlp), shared_(shared) {
    if (shared == nullptr) return;
    for (int l = 0; l < mlp.layers; ++l) {
      const int inputs = mlp.Inputs(l), outputs = mlp.Outputs(l), stride = inputs + kPad;
      const float* from = mlp.parameters + mlp.Offset(l);
      float* to = shared + SharedOffset(l);
      for (int i = static_cast<int>(threadIdx.x); i < outputs * inputs;
           i += static_cast<int>(blockDim.x))
        to[i / inputs * stride + i % inputs] = from[i];
      for (int i = static_cast<int>(threadIdx.x); i < outputs;
           i += static_cast<int>(blockDim.x))
        to[outputs * stride + i] = from[outputs * inputs + i];
    }
    __syncthreads();
  }
  __device__ int Stride(int l) const {
    return mlp_.Inputs(l) + (shared_ != nullptr ? kPad : 0);
  }
  __device__ const float* Matrix(int l) const {
    return shared_ != nullptr ? shared_ + SharedOffset(l) : mlp_.parameters + mlp_.Offset(l);
  }
  __device__ const float* Bias(int l) const { return Matrix(l) + mlp_.Outputs(l) * Stride(l); }
  __host__ __device__ static int SharedFloats(const MlpView<kEnds>& mlp) {
    int floats = 0;
    for (int l = 0; l < mlp.layers; ++l) floats += mlp.Outputs(l) * (mlp.Inputs(l) + kPad + 1);
    return floats;
  }

 private:
  __device__ int SharedOffset(int l) const {
    int offset = 0;
    for (int i = 0; i < l; ++i) offset += mlp_.Outputs(i) * (mlp_.Inputs(i) + kPad + 1);
    return offset;
  }
  const MlpView<kEnds>& mlp_;
  float* shared_;
};

struct LanePlace {
  int g, t;
  __device__ LanePlace()
      : g(static_cast<int>(threadIdx.x & 31) / 4), t(static_cast<int>(threadIdx.x & 3)) {}
};

// Rows [row, row + 16) of a row-major [n, width] array; rows at n and beyond are zero.
template <int kTiles>
__device__ void LoadRows(const float* from, int width, int64_t row, int64_t n,
                         Tile (&tile)[kTiles]) {
  const LanePlace lane;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = row + lane.g + 8 * half;
#pragma unroll
    for (int j = 0; j < kTiles; ++j) {
      const float2 pair =
          r < n ? *reinterpret_cast<const float2*>(from + r * width + 8 * j + 2 * lane.t)
                : make_float2(0, 0);
      tile[j].x[2 * half] = pair.x;
      tile[j].x[2 * half + 1] = pair.y;
    }
  }
}

template <int kTiles>
__device__ void StoreRows(float* to, int width, int64_t row, int64_t n,
                          const Tile (&tile)[kTiles]) {
  const LanePlace lane;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = row + lane.g + 8 * half;
    if (r >= n) continue;
#pragma unroll
    for (int j = 0; j < kTiles; ++j)
      *reinterpret_cast<float2*>(to + r * width + 8 * j + 2 * lane.t) =
          make_float2(tile[j].x[2 * half], tile[j].x[2 * half + 1]);
  }
}

// out = A in + b
template <bool kSplit, int kEnds, int kIn, int kOut>
__device__ void Dense(const Weights<kEnds>& weights, int layer, const Tile (&in)[kIn],
                      Tile (&out)[kOut]) {
  const LanePlace lane;
  const float *matrix = weights.Matrix(layer), *bias = weights.Bias(layer);
  const int stride = weights.Stride(layer);
#pragma unroll
  for (int j = 0; j < kOut; ++j) {
    const float2 start = *reinterpret_cast<const float2*>(bias + 8 * j + 2 * lane.t);
    out[j].x[0] = out[j].x[2] = start.x;
    out[j].x[1] = out[j].x[3] = start.y;
#pragma unroll
    for (int i = 0; i < kIn; ++i) {
      const float2 pair = *reinterpret_cast<const float2*>(matrix + (8 * j + lane.g) * stride +
                                                           8 * i + 2 * lane.t);
      const float right[2] = {pair.x, pair.y};
      Multiply<kSplit>(&out[j], in[i], right);
    }
  }
}

// d_in = A^T d_out
template <bool kSplit, int kEnds, int kIn, int kOut>
__device__ void DenseAdjointRows(const Weights<kEnds>& weights, int layer,
                                 const Tile (&d_out)[kOut], Tile (&d_in)[kIn]) {
  const LanePlace lane;
  const float* matrix = weights.Matrix(layer);
  const int stride = weights.Stride(layer);
#pragma unroll
  for (int i = 0; i < kIn; ++i) {
    d_in[i] = {};
#pragma unroll
    for (int j = 0; j < kOut; ++j) {
      const float* at = matrix + (8 * j + 2 * lane.t) * stride + 8 * i + lane.g;
      const float right[2] = {at[0], at[stride]};
      Multiply<kSplit>(&d_in[i], d_out[j], right);
    }
  }
}

// x becomes act(x); slope becomes act'(x) if kWantSlope.
template <bool kWantSlope, int kEnds>
__device__ void ActivateRows(const MlpView<kEnds>& mlp, Tile (&x)[kHiddenTiles],
                             Tile (&slope)[kHiddenTiles]) {
  if (mlp.activation == Activation::kSine) {
#pragma unroll
    for (int j = 0; j < kHiddenTiles; ++j)
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        if constexpr (kWantSlope) {
          float cosine;
          sincosf(mlp.omega * x[j].x[i], &x[j].x[i], &cosine);
          slope[j].x[i] = mlp.omega * cosine;
        } else {
          x[j].x[i] = sinf(mlp.omega * x[j].x[i]);
        }
      }
    return;
  }
#pragma unroll
  for (int j = 0; j < kHiddenTiles; ++j)
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      if constexpr (kWantSlope)
        slope[j].x[i] = ActivateDerivative(mlp.activation, mlp.omega, x[j].x[i]);
      x[j].x[i] = Activate(mlp.activation, mlp.omega, x[j].x[i]);
    }
}

}  // namespace regrade

#endif
