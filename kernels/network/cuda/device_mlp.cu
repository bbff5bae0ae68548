// See EQ(mlp). The adjoint is three kernels: the first runs each row forward and back and
// stores every layer's input x_{l-1} and dL/d(A_l x_{l-1} + b_l); the second sums their outer
// products over the rows, one block for a part of the rows and a layer; the third adds the
// parts in their order.
#include <algorithm>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/network/cuda/device_mlp.h"
#include "kernels/network/cuda/warp_dense.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int64_t kChunk = 1 << 16;  // rows of the adjoint at a time

// Layer inputs and derivatives of a chunk: [layers - 1, chunk, kMlpHidden] of each.
struct Scratch {
  float *inputs, *slopes;
  int64_t rows;
  __device__ float* Input(int l) const { return inputs + (l - 1) * rows * kMlpHidden; }
  __device__ float* Slope(int l) const { return slopes + (l - 1) * rows * kMlpHidden; }
};

template <bool kSplit, bool kKeep, int kEnds>
__device__ void WalkDown(const MlpView<kEnds>& mlp, const Weights<kEnds>& weights,
                         const float* input, int64_t row, int64_t n, const Scratch& scratch,
                         Tile (&hidden)[kHiddenTiles]) {
  Tile first[kEnds / 8], slope[kHiddenTiles];
  LoadRows(input, kEnds, row, n, first);
  Dense<kSplit>(weights, 0, first, hidden);
  for (int l = 1;; ++l) {
    ActivateRows<kKeep>(mlp, hidden, slope);
    if constexpr (kKeep) {
      StoreRows(scratch.Input(l), kMlpHidden, row, n, hidden);
      StoreRows(scratch.Slope(l), kMlpHidden, row, n, slope);
    }
    if (l + 1 == mlp.layers) return;
    Tile next[kHiddenTiles];
    Dense<kSplit>(weights, l, hidden, next);
#pragma unroll
    for (int j = 0; j < kHiddenTiles; ++j) hidden[j] = next[j];
  }
}

// Number of rows: n, or fewer if counted on the device. `begin`: first row of a chunk.
struct RowCount {
  int64_t n;
  const int32_t* counted;  // may be null
  int64_t begin;
  __device__ int64_t Get() const {
    if (counted == nullptr) return n;
    const int64_t left = *counted - begin;
    return left < n ? left : n;
  }
};

__device__ inline int64_t WarpOfGrid() {
  return (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
}

template <bool kSplit, int kEnds>
__global__ void __launch_bounds__(kThreads)
    ForwardKernel(MlpView<kEnds> mlp, bool stage, const float* input, RowCount count,
                  float* output) {
  const int64_t n = count.Get();
  if (n <= 0) return;
  extern __shared__ float4 shared_quads[];
  const Weights<kEnds> weights(mlp, stage ? reinterpret_cast<float*>(shared_quads) : nullptr);
  const int64_t warps = static_cast<int64_t>(gridDim.x) * (blockDim.x / 32);
  for (int64_t row = WarpOfGrid() * kRows; row < n; row += warps * kRows) {
    Tile hidden[kHiddenTiles], last[kEnds / 8];
    WalkDown<kSplit, false>(mlp, weights, input, row, n, {}, hidden);
    Dense<kSplit>(weights, mlp.layers - 1, hidden, last);
    StoreRows(output, kEnds, row, n, last);
  }
}

template <bool kSplit, int kEnds>
__global__ void __launch_bounds__(kThreads)
    AdjointRowsKernel(MlpView<kEnds> mlp, bool stage, const float* input, const float* d_output,
                      RowCount count, Scratch scratch) {
  const int64_t n = count.Get();
  if (n <= 0) return;
  extern __shared__ float4 shared_quads[];
  const Weights<kEnds> weights(mlp, stage ? reinterpret_cast<float*>(shared_quads) : nullptr);
  const int64_t warps = static_cast<int64_t>(gridDim.x) * (blockDim.x / 32);
  for (int64_t row = WarpOfGrid() * kRows; row < n; row += warps * kRows) {
    Tile d_hidden[kHiddenTiles], slope[kHiddenTiles];
    WalkDown<kSplit, true>(mlp, weights, input, row, n, scratch,
                           d_hidden);  // its contents are already stored
    Tile d_last[kEnds / 8];
    LoadRows(d_output, kEnds, row, n, d_last);
    DenseAdjointRows<kSplit>(weights, mlp.layers - 1, d_last, d_hidden);
    for (int l = mlp.layers - 1;; --l) {
      LoadRows(scratch.Slope(l), kMlpHidden, row, n, slope);
#pragma unroll
      for (int j = 0; j < kHiddenTiles; ++j)
#pragma unroll
        for (int i = 0; i < 4; ++i) slope[j].x[i] *= d_hidden[j].x[i];
      StoreRows(scratch.Slope(l), kMlpHidden, row, n, slope);  // now dL/d(A x + b)
      if (l == 1) break;
      DenseAdjointRows<kSplit>(weights, l - 1, slope, d_hidden);
    }
  }
}

// Blocks (x: part of the rows, y: layer) of four warps, each computing 16 outputs.
constexpr int kOuterParts = 256, kOuterRows = 32, kOuterStride = kMlpHidden + 4,
              kOuterThreads = 128;

__device__ inline void StageRows(const float* from, int width, int64_t row, int64_t n,
                                 float* to) {
  const int quads = width / 4;
  for (int i = static_cast<int>(threadIdx.x); i < kOuterRows * quads; i += kOuterThreads) {
    const int r = i / quads, q = i % quads;
    *reinterpret_cast<float4*>(to + r * kOuterStride + 4 * q) =
        row + r < n ? *reinterpret_cast<const float4*>(from + (row + r) * width + 4 * q)
                    : make_float4(0, 0, 0, 0);
  }
}

template <bool kSplit, int kEnds>
__global__ void __launch_bounds__(kOuterThreads)
    OuterProductsKernel(MlpView<kEnds> mlp, const float* input, const float* d_output,
                        RowCount count, Scratch scratch, float* parts, int64_t parameters) {
  const int64_t n = count.Get();
  if (blockIdx.x * static_cast<int64_t>(kOuterRows) >= n) return;
  __shared__ float4 left_quads[kOuterRows * kOuterStride / 4],
      right_quads[kOuterRows * kOuterStride / 4];
  float *left_rows = reinterpret_cast<float*>(left_quads),
        *right_rows = reinterpret_cast<float*>(right_quads);
  const int layer = static_cast<int>(blockIdx.y), inputs = mlp.Inputs(layer),
            outputs = mlp.Outputs(layer);
  const float* x = layer == 0 ? input : scratch.Input(layer);
  const float* d = layer + 1 == mlp.layers ? d_output : scratch.Slope(layer + 1);
  const LanePlace lane;
  const int first_output = static_cast<int>(threadIdx.x / 32) * kRows;
  Tile sums[kHiddenTiles] = {};
  float bias_low = 0, bias_high = 0;
  const int64_t stride = static_cast<int64_t>(gridDim.x) * kOuterRows;
  for (int64_t row = blockIdx.x * static_cast<int64_t>(kOuterRows); row < n; row += stride) {
    __syncthreads();
    StageRows(d, outputs, row, n, left_rows);
    StageRows(x, inputs, row, n, right_rows);
    __syncthreads();
    if (first_output >= outputs) continue;
#pragma unroll
    for (int k = 0; k < kOuterRows; k += 8) {
      const float* at = left_rows + (k + 2 * lane.t) * kOuterStride + first_output + lane.g;
      const Tile left = {at[0], at[kOuterStride], at[8], at[kOuterStride + 8]};
      bias_low += left.x[0] + left.x[1];
      bias_high += left.x[2] + left.x[3];
      for (int j = 0; j < kHiddenTiles; ++j) {
        if (8 * j >= inputs) break;
        const float* of = right_rows + (k + 2 * lane.t) * kOuterStride + 8 * j + lane.g;
        const float right[2] = {of[0], of[kOuterStride]};
        Multiply<kSplit>(&sums[j], left, right);
      }
    }
  }
  if (first_output >= outputs) return;
  float* to = parts + blockIdx.x * parameters + mlp.Offset(layer);
#pragma unroll
  for (int j = 0; j < kHiddenTiles; ++j) {
    if (8 * j >= inputs) break;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const int output = first_output + lane.g + 8 * (i / 2), in = 8 * j + 2 * lane.t + i % 2;
      to[output * inputs + in] = sums[j].x[i];
    }
  }
#pragma unroll
  for (int other = 1; other < 4; other *= 2) {
    bias_low += __shfl_xor_sync(0xffffffffu, bias_low, other);
    bias_high += __shfl_xor_sync(0xffffffffu, bias_high, other);
  }
  if (lane.t != 0) return;
  to[outputs * inputs + first_output + lane.g] = bias_low;
  to[outputs * inputs + first_output + lane.g + 8] = bias_high;
}

__global__ void AddPartsKernel(const float* parts, int64_t parameters, RowCount count,
                               double* gradient) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int64_t n = count.Get(), blocks = (n + kOuterRows - 1) / kOuterRows;
  if (i >= parameters || n <= 0) return;
  const int used = blocks < kOuterParts ? static_cast<int>(blocks) : kOuterParts;
  double sum = 0;
#pragma unroll 8
  for (int part = 0; part < used; ++part)
    sum += static_cast<double>(parts[part * parameters + i]);
  gradient[i] += sum;
}

// Calls body(MlpView) of the network's width.
template <typename Body>
void ByEnds(const FusedMlp& shape, const DeviceBuffer<float>& parameters, const Body& body) {
  const auto call = [&](auto view) {
    view = {parameters.data(), static_cast<int>(shape.layers.size()), shape.activation,
            shape.omega};
    body(view);
  };
  if (shape.ends == 32)
    call(MlpView<32>());
  else
    call(MlpView<64>());
}

// Launch configuration of kernels over rows: weights are in shared memory if they fit.
struct WalkLaunch {
  bool stage;
  unsigned blocks, bytes;

  template <typename Kernel, int kEnds>
  WalkLaunch(const Kernel& kernel, const MlpView<kEnds>& mlp, int64_t n) {
    int most = 0, processors = 1;
    cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0);
    cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0);
    const int wanted = Weights<kEnds>::SharedFloats(mlp) * static_cast<int>(sizeof(float));
    stage = wanted <= most;
    bytes = stage ? static_cast<unsigned>(wanted) : 0;
    if (stage)
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, wanted);
    const int64_t tiles = (n + kRows - 1) / kRows, tiles_a_block = kThreads / 32;
    blocks = static_cast<unsigned>(
        std::clamp<int64_t>((tiles + tiles_a_block - 1) / tiles_a_block, 1, 2 * processors));
  }
};

template <bool kSplit, int kEnds>
void LaunchForward(const MlpView<kEnds>& mlp, const float* input, const RowCount& count,
                   float* output) {
  const WalkLaunch launch(ForwardKernel<kSplit, kEnds>, mlp, count.n);
  ForwardKernel<kSplit, kEnds><<<launch.blocks, kThreads, launch.bytes, LaunchStream()>>>(
      mlp, launch.stage, input, count, output);
  CheckLaunch("mlp_forward");
}

template <bool kSplit, int kEnds>
void LaunchAdjoint(const MlpView<kEnds>& mlp, const float* input, const float* d_output,
                   const RowCount& count, const Scratch& scratch,
                   const DeviceBuffer<float>& parts, const DeviceBuffer<double>& gradient) {
  const WalkLaunch launch(AdjointRowsKernel<kSplit, kEnds>, mlp, count.n);
  AdjointRowsKernel<kSplit, kEnds><<<launch.blocks, kThreads, launch.bytes, LaunchStream()>>>(
      mlp, launch.stage, input, d_output, count, scratch);
  CheckLaunch("mlp_adjoint_rows");
  const dim3 blocks(kOuterParts, static_cast<unsigned>(mlp.layers));
  OuterProductsKernel<kSplit, kEnds><<<blocks, kOuterThreads, 0, LaunchStream()>>>(
      mlp, input, d_output, count, scratch, parts.data(), gradient.size());
  CheckLaunch("mlp_outer_products");
  AddPartsKernel<<<BlocksFor(gradient.size()), kThreads, 0, LaunchStream()>>>(
      parts.data(), gradient.size(), count, gradient.data());
  CheckLaunch("mlp_add_parts");
}

}  // namespace

void DeviceMlp::Forward(MlpPrecision precision, const float* input, int64_t n, float* output,
                        const int32_t* counted) const {
  if (n == 0) return;
  ByEnds(shape_, parameters_, [&](const auto& mlp) {
    if (precision == MlpPrecision::kSplit)
      LaunchForward<true>(mlp, input, {n, counted, 0}, output);
    else
      LaunchForward<false>(mlp, input, {n, counted, 0}, output);
  });
}

void DeviceMlp::ReserveAdjoint(int64_t n) {
  const int64_t kept =
      (static_cast<int64_t>(shape_.layers.size()) - 1) * std::min(n, kChunk) * kMlpHidden;
  if (scratch_.size() < 2 * kept)
    scratch_ = DeviceBuffer<float>(2 * kept, "layer values of the style network");
  if (parts_.empty())
    parts_ =
        DeviceBuffer<float>(kOuterParts * gradient_.size(), "parts of the style's gradient");
}

void DeviceMlp::AddAdjoint(MlpPrecision precision, const float* input, const float* d_output,
                           int64_t n, const int32_t* counted) {
  const int64_t rows = std::min(n, kChunk),
                kept = (std::ssize(shape_.layers) - 1) * rows * kMlpHidden;
  ReserveAdjoint(n);
  for (int64_t begin = 0; begin < n; begin += rows) {
    const RowCount count{std::min(rows, n - begin), counted, begin};
    const Scratch scratch{scratch_.data(), scratch_.data() + kept, rows};
    const float *from = input + begin * shape_.ends, *d_from = d_output + begin * shape_.ends;
    ByEnds(shape_, parameters_, [&](const auto& mlp) {
      if (precision == MlpPrecision::kSplit)
        LaunchAdjoint<true>(mlp, from, d_from, count, scratch, parts_, gradient_);
      else
        LaunchAdjoint<false>(mlp, from, d_from, count, scratch, parts_, gradient_);
    });
  }
}

#else

void DeviceMlp::Forward(MlpPrecision, const float*, int64_t, float*, const int32_t*) const {
  DeviceWait("mlp_forward");
}
void DeviceMlp::ReserveAdjoint(int64_t) { DeviceWait("mlp_adjoint"); }
void DeviceMlp::AddAdjoint(MlpPrecision, const float*, const float*, int64_t, const int32_t*) {
  DeviceWait("mlp_adjoint");
}

#endif

DeviceMlp::DeviceMlp(const FusedMlp& mlp)
    : parameters_(mlp.NumParameters(), "weights of the style network"),
      gradient_(mlp.NumParameters(), "gradient of the style network") {
  gradient_.Zero();
  Set(mlp);
}

void DeviceMlp::Set(const FusedMlp& mlp) {
  REGRADE_CHECK_EQ(mlp.NumParameters(), parameters_.size());
  shape_ = mlp;
  std::vector<float> parameters(static_cast<size_t>(mlp.NumParameters()));
  for (size_t l = 0; l < mlp.layers.size(); ++l) {
    const FusedMlp::Layer& layer = mlp.layers[l];
    float* to = parameters.data() + mlp.Offset(l);
    std::copy_n(layer.weight.data(), layer.weight.size(), to);
    std::copy_n(layer.bias.data(), layer.bias.size(), to + layer.weight.size());
  }
  parameters_.CopyIn(parameters.data(), parameters_.size());
}

void DeviceMlp::TakeGradient(DenseNetwork<double>* gradient) {
  std::vector<double> sums(static_cast<size_t>(gradient_.size()));
  gradient_.CopyOut(sums.data(), gradient_.size());
  gradient_.Zero();
  REGRADE_CHECK_EQ(gradient->layers.size(), shape_.layers.size());
  for (size_t l = 0; l < shape_.layers.size(); ++l) {
    DenseLayer<double>& layer = gradient->layers[l];
    const int inputs = shape_.layers[l].inputs, outputs = shape_.layers[l].outputs;
    const double* from = sums.data() + shape_.Offset(l);
    for (int o = 0; o < layer.outputs; ++o) {
      layer.bias[static_cast<size_t>(o)] += from[outputs * inputs + o];
      for (int i = 0; i < layer.inputs; ++i)
        layer.weight[static_cast<size_t>(o) * layer.inputs + i] += from[o * inputs + i];
    }
  }
}

}  // namespace regrade
