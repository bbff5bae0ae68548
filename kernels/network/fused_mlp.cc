#include "kernels/network/fused_mlp.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "kernels/base/error.h"

namespace regrade {

namespace simd_baseline {
extern const FusedMlpFunctions kFusedMlp;
}
namespace simd_avx2 {
extern const FusedMlpFunctions kFusedMlp;
}
namespace simd_avx512 {
extern const FusedMlpFunctions kFusedMlp;
}

const FusedMlpFunctions* FusedMlpFor(const char* name) {
  if (std::strcmp(name, "baseline") == 0) return &simd_baseline::kFusedMlp;
#if defined(REGRADE_X86)
  if (std::strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2") &&
      __builtin_cpu_supports("fma"))
    return &simd_avx2::kFusedMlp;
  if (std::strcmp(name, "avx512") == 0 && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw"))
    return &simd_avx512::kFusedMlp;
#endif
  return nullptr;
}

namespace {

constexpr int64_t kRowsPerTask = 960;  // forward: ten blocks, to amortise starting a task
constexpr int kGroups = 64;            // adjoint: partial sums, for any number of threads

const FusedMlpFunctions* Best() {
  for (const char* name : {"avx512", "avx2"})
    if (const FusedMlpFunctions* functions = FusedMlpFor(name)) return functions;
  return FusedMlpFor("baseline");
}

std::atomic<const FusedMlpFunctions*>& InUse() {
  static std::atomic<const FusedMlpFunctions*> functions = Best();
  return functions;
}

}  // namespace

void UseFusedMlp(const char* name) {
  const FusedMlpFunctions* functions = name == nullptr ? Best() : FusedMlpFor(name);
  REGRADE_CHECK(functions != nullptr);
  InUse() = functions;
}

int64_t FusedMlp::Offset(size_t layer) const {
  int64_t offset = 0;
  for (size_t l = 0; l < layer; ++l)
    offset += static_cast<int64_t>(layers[l].outputs) * (layers[l].inputs + 1);
  return offset;
}

int64_t FusedMlp::NumParameters() const { return Offset(layers.size()); }

int64_t FusedMlp::WorkspaceSize() const {
  int64_t lanes = ends + 2 * kMlpHidden + 1;
  for (const Layer& layer : layers) lanes += 2 * layer.inputs;
  return kMlpBlock * lanes;  // the last one is a row of zeros
}

void ActivateRowsPlain(Activation activation, float omega, int n, float* x, float* slope) {
  for (int i = 0; i < n; ++i) {
    if (slope != nullptr) slope[i] = ActivateDerivative(activation, omega, x[i]);
    x[i] = Activate(activation, omega, x[i]);
  }
}

FusedMlp MakeFusedMlp(const DenseNetwork<float>& network) {
  REGRADE_CHECK_GE(network.layers.size(), 2u);
  REGRADE_CHECK_LE(network.layers.size(), static_cast<size_t>(kMlpMaxLayers));
  FusedMlp mlp;
  mlp.activation = network.activation;
  mlp.omega = network.omega;
  mlp.ends =
      MlpEndLanes(std::max(network.layers.front().inputs, network.layers.back().outputs));
  for (size_t l = 0; l < network.layers.size(); ++l) {
    const DenseLayer<float>& dense = network.layers[l];
    FusedMlp::Layer layer;
    layer.inputs = l == 0 ? mlp.ends : kMlpHidden;
    layer.outputs = l + 1 == network.layers.size() ? mlp.ends : kMlpHidden;
    REGRADE_CHECK_LE(dense.inputs, layer.inputs);
    REGRADE_CHECK_LE(dense.outputs, layer.outputs);
    // A padded hidden neuron would feed act(0) to the next layer and receive bias gradients.
    if (l > 0) REGRADE_CHECK_EQ(dense.inputs, kMlpHidden);
    layer.weight.Resize(static_cast<int64_t>(layer.outputs) * layer.inputs);
    layer.transposed.Resize(layer.weight.size());
    layer.bias.Resize(layer.outputs);
    for (int o = 0; o < dense.outputs; ++o) {
      layer.bias[o] = dense.bias[o];
      for (int i = 0; i < dense.inputs; ++i) {
        const float w = dense.weight[static_cast<size_t>(o) * dense.inputs + i];
        layer.weight[o * layer.inputs + i] = w;
        layer.transposed[i * layer.outputs + o] = w;
      }
    }
    mlp.layers.push_back(std::move(layer));
  }
  return mlp;
}

void FusedForward(const FusedMlp& mlp, const float* input, int64_t n, float* output) {
  const FusedMlpFunctions* functions = InUse();
  const int64_t tasks = (n + kRowsPerTask - 1) / kRowsPerTask;
#pragma omp parallel
  {
    Buffer<float> workspace(mlp.WorkspaceSize());
#pragma omp for schedule(dynamic, 1)
    for (int64_t t = 0; t < tasks; ++t) {
      const int64_t begin = t * kRowsPerTask;
      functions->forward(mlp, input + begin * mlp.ends, std::min(kRowsPerTask, n - begin),
                         output + begin * mlp.ends, workspace.data());
    }
  }
}

void FusedAdjoint(const FusedMlp& mlp, const float* input, const float* d_output, int64_t n,
                  DenseNetwork<double>* gradient) {
  const FusedMlpFunctions* functions = InUse();
  const int64_t size = mlp.NumParameters();
  Buffer<float> partials(kGroups * size);
#pragma omp parallel
  {
    Buffer<float> workspace(mlp.WorkspaceSize());
#pragma omp for schedule(dynamic, 1)
    for (int g = 0; g < kGroups; ++g) {
      const int64_t begin = n * g / kGroups, end = n * (g + 1) / kGroups;
      if (begin < end)
        functions->adjoint(mlp, input + begin * mlp.ends, d_output + begin * mlp.ends,
                           end - begin, partials.data() + g * size, workspace.data());
    }
  }
  for (size_t l = 0; l < mlp.layers.size(); ++l) {
    DenseLayer<double>& layer = gradient->layers[l];
    const int padded_inputs = mlp.layers[l].inputs;
    for (int g = 0; g < kGroups; ++g) {
      const float* d_weight = partials.data() + g * size + mlp.Offset(l);
      const float* d_bias =
          d_weight + static_cast<int64_t>(mlp.layers[l].outputs) * padded_inputs;
      for (int o = 0; o < layer.outputs; ++o) {
        layer.bias[o] += d_bias[o];
        for (int i = 0; i < layer.inputs; ++i)
          layer.weight[static_cast<size_t>(o) * layer.inputs + i] +=
              d_weight[o * padded_inputs + i];
      }
    }
  }
}

}  // namespace regrade
