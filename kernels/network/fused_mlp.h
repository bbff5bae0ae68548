// The CPU's fast path through a narrow network for many voxels: blocks of rows stay in the
// caches for all layers, forward and back. Tests compare it with dense_layer.h.
//
// Rows are padded: inputs and outputs to FusedMlp::ends, hidden layers are kMlpHidden wide.
// Padding weights and values are zero, so padding costs time and does not change results.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/buffer.h"
#include "kernels/base/host_device.h"
#include "kernels/network/activation.h"
#include "kernels/network/dense_layer.h"

namespace regrade {

inline constexpr int kMlpHidden = 64;
// Lanes of a row with so many values, at most 64.
HD constexpr int MlpEndLanes(int values) { return values <= 32 ? 32 : 64; }
inline constexpr int kMlpMaxLayers = 8;
inline constexpr int kMlpBlock =
    96;  // voxels: six layers and their slopes are 250 KB, an L2 cache

// A dense network with padded layers, each matrix stored in both orders.
struct FusedMlp {
  struct Layer {
    int outputs = 0, inputs = 0;  // padded
    Buffer<float> weight;         // [outputs, inputs]
    Buffer<float> transposed;     // [inputs, outputs]
    Buffer<float> bias;           // [outputs]
  };
  Activation activation = Activation::kSine;
  float omega = 1;
  int ends = 0;  // lanes of a row of inputs or outputs, see MlpEndLanes
  std::vector<Layer> layers;

  // Number of all padded weights and biases, and offset of layer l: weights first, then biases.
  int64_t NumParameters() const;
  int64_t Offset(size_t layer) const;
  // Floats of working memory per thread.
  int64_t WorkspaceSize() const;
};

// The network must have at least two and at most kMlpMaxLayers layers, hidden ones kMlpHidden
// wide, inputs and outputs of at most 64.
FusedMlp MakeFusedMlp(const DenseNetwork<float>& network);

// output [n, ends] of input [n, ends].
void FusedForward(const FusedMlp& mlp, const float* input, int64_t n, float* output);

// Adds to `gradient` (the unpadded shapes) the adjoint of FusedForward for d_output
// [n, ends]. The forward pass is recomputed block by block, so memory does not grow
// with n. Sums have a fixed order: the result does not depend on the number of threads.
void FusedAdjoint(const FusedMlp& mlp, const float* input, const float* d_output, int64_t n,
                  DenseNetwork<double>* gradient);

// One set of functions per instruction set.
struct FusedMlpFunctions {
  const char* name;
  // Rows [0, n) of input and output, on the calling thread; `workspace` [WorkspaceSize()].
  void (*forward)(const FusedMlp&, const float* input, int64_t n, float* output,
                  float* workspace);
  // The same, and adds the gradient to partial [NumParameters()].
  void (*adjoint)(const FusedMlp&, const float* input, const float* d_output, int64_t n,
                  float* partial, float* workspace);
  // sine [n] and cosine [n] of x [n]: absolute error <= 2e-7 for |x| <= 50, std::sin beyond.
  void (*sine_cosine)(const float* x, int64_t n, float* sine, float* cosine);
};

// x [n] becomes act(x); slope [n], unless null, act'(x). The activations without a vector form.
void ActivateRowsPlain(Activation activation, float omega, int n, float* x, float* slope);

// For tests and benchmarks: "baseline", "avx2", "avx512"; nullptr if the processor lacks it.
const FusedMlpFunctions* FusedMlpFor(const char* name);
// Selects a set for tests; `name` null selects the processor's best.
void UseFusedMlp(const char* name);

}  // namespace regrade
