#include <algorithm>
#include <cfloat>

#include "kernels/base/error.h"
#include "kernels/device/device_stream.h"
#include "kernels/network/lipschitz_layer.h"
#include "stylize/cuda/device_lipschitz.h"

namespace regrade {

struct DeviceLipschitz::View {
  Shape shape;
  TrainingParams params;
  float *parameters, *vectors, *first_moment, *second_moment, *gradient;
  OptimizerState* state;
  int32_t* not_finite;
};

DeviceLipschitz::View DeviceLipschitz::GetView() const {
  return {shape_,
          params_,
          parameters_.data(),
          vectors_.data(),
          first_moment_.data(),
          second_moment_.data(),
          gradient_.data(),
          state_.data(),
          not_finite_.data()};
}

#if defined(__CUDACC__)

namespace {

constexpr int kLayerThreads = 256;    // of a layer's block
constexpr int kUpdateThreads = 1024;  // of the one block of all layers
constexpr int kSide = 64;             // no layer is wider
constexpr int kSideStride = kSide + 1;

// The sum, or the largest, over a block, in every thread; `scratch` [32].
template <typename T, typename Combine>
__device__ T OverBlock(T value, T* scratch, const Combine& combine) {
  for (int d = 16; d > 0; d /= 2)
    value = combine(value, __shfl_xor_sync(0xffffffffu, value, d));
  __syncthreads();
  if (threadIdx.x % 32 == 0) scratch[threadIdx.x / 32] = value;
  __syncthreads();
  const int warps = static_cast<int>(blockDim.x) / 32;
  T all = scratch[0];
  for (int w = 1; w < warps; ++w) all = combine(all, scratch[w]);
  return all;
}
template <typename T>
__device__ T SumOverBlock(T value, T* scratch) {
  return OverBlock(value, scratch, [](T a, T b) { return a + b; });
}
__device__ float LargestOverBlock(float value, float* scratch) {
  return OverBlock(value, scratch, [](float a, float b) { return a > b ? a : b; });
}

// A layer's W / scale and its singular vectors, in a block's shared memory.
struct SharedLayer {
  float matrix[kSide * kSideStride];
  float u[kSide], v[kSide];
  float scratch[32];
  double wide_scratch[32];
};

// to [rows] = normalised sum over columns of W / scale (or its transpose) times from. Four
// threads a row. Returns the length.
template <bool kTransposed>
__device__ float MultiplyAndNormalize(SharedLayer* layer, int rows, int columns,
                                      const float* from, float* to) {
  const int row = static_cast<int>(threadIdx.x) / 4, part = static_cast<int>(threadIdx.x) % 4;
  float sum = 0;
  if (row < rows)
    for (int c = part; c < columns; c += 4)
      sum +=
          layer->matrix[kTransposed ? c * kSideStride + row : row * kSideStride + c] * from[c];
  sum += __shfl_xor_sync(0xffffffffu, sum, 1);
  sum += __shfl_xor_sync(0xffffffffu, sum, 2);
  const bool mine = row < rows && part == 0;
  const float length = sqrtf(SumOverBlock(mine ? sum * sum : 0.0f, layer->scratch));
  if (mine) to[row] = length > 0 ? sum / length : sum;
  __syncthreads();
  return length;
}

// See StartPowerIteration; rare enough for one thread.
__device__ void StartAtLongestColumn(SharedLayer* layer, int outputs, int inputs) {
  if (threadIdx.x == 0) {
    int longest = 0;
    float longest_sum = -1;
    for (int i = 0; i < inputs; ++i) {
      float sum = 0;
      for (int o = 0; o < outputs; ++o) {
        const float x = layer->matrix[o * kSideStride + i];
        sum += x * x;
      }
      if (sum > longest_sum) longest_sum = sum, longest = i;
      layer->v[i] = 0;
    }
    layer->v[longest] = 1;
  }
  __syncthreads();
}

// A block a layer. A step that Update will not make leaves the vectors alone: it is made again.
template <typename View>
__global__ void __launch_bounds__(kLayerThreads)
    ActivateWeightsKernel(View all, float* mlp_parameters, const int32_t* skip) {
  __shared__ SharedLayer layer;
  if (*skip != 0 || all.state->halted != 0) return;
  const int l = static_cast<int>(blockIdx.x), outputs = all.shape.outputs[l],
            inputs = all.shape.inputs[l], size = outputs * inputs;
  const int thread = static_cast<int>(threadIdx.x);
  const float* weight = all.parameters + all.shape.parameters[l];
  const float *bias = weight + size, k = bias[outputs];
  float *u = all.vectors + all.shape.vectors[l], *v = u + outputs;
  float largest = 0;
  for (int i = thread; i < size; i += kLayerThreads) largest = fmaxf(largest, fabsf(weight[i]));
  const float scale = LargestOverBlock(largest, layer.scratch);
  float square = 0;
  for (int i = thread; i < size; i += kLayerThreads) {
    const float x = scale > 0 ? weight[i] / scale : 0.0f;
    layer.matrix[i / inputs * kSideStride + i % inputs] = x;
    square += x * x;
  }
  square = SumOverBlock(square, layer.scratch);
  if (thread < outputs) layer.u[thread] = u[thread];
  if (thread < inputs) layer.v[thread] = v[thread];
  __syncthreads();
  for (int step = 0; step < all.params.update.options.norm_steps && scale > 0; ++step) {
    const float length = MultiplyAndNormalize<true>(&layer, inputs, outputs, layer.u, layer.v);
    if (!(length > FLT_EPSILON * sqrtf(square))) StartAtLongestColumn(&layer, outputs, inputs);
    MultiplyAndNormalize<false>(&layer, outputs, inputs, layer.v, layer.u);
  }
  float part = 0;
  for (int i = thread; i < size; i += kLayerThreads)
    part += layer.u[i / inputs] * layer.matrix[i / inputs * kSideStride + i % inputs] *
            layer.v[i % inputs];
  const float sigma = SumOverBlock(part, layer.scratch);
  const float factor = sigma > 0 ? Squareplus(k) / sigma : 0.0f;
  float* to = mlp_parameters + all.shape.mlp[l];
  const int stride = all.shape.mlp_inputs[l];
  for (int i = thread; i < size; i += kLayerThreads) {
    const int o = i / inputs, c = i % inputs;
    const float in = l == 0 && c < all.params.scaled_inputs ? all.params.input_scale : 1.0f;
    to[o * stride + c] = factor * layer.matrix[o * kSideStride + c] * in;
  }
  if (thread < outputs) {
    to[all.shape.mlp_outputs[l] * stride + thread] = bias[thread];
    u[thread] = layer.u[thread];
  }
  if (thread < inputs) v[thread] = layer.v[thread];
}

// EQ(lipschitz-layer)'s adjoint and the regularisation's; a block a layer, in double.
template <typename View>
__global__ void __launch_bounds__(kLayerThreads)
    GradientKernel(View all, const double* d_mlp, const unsigned long long* rays) {
  __shared__ double scratch[32];
  __shared__ float float_scratch[32];
  const int l = static_cast<int>(blockIdx.x), outputs = all.shape.outputs[l],
            inputs = all.shape.inputs[l], size = outputs * inputs;
  const int thread = static_cast<int>(threadIdx.x), stride = all.shape.mlp_inputs[l];
  const float* weight = all.parameters + all.shape.parameters[l];
  const double k = weight[size + outputs];
  const float *u = all.vectors + all.shape.vectors[l], *v = u + outputs;
  const double* from = d_mlp + all.shape.mlp[l];
  const double divisor =
      all.params.loss_divisor > 0 ? all.params.loss_divisor : 3 * static_cast<double>(*rays);
  const double loss_factor = *rays > 0 ? 1 / divisor : 0.0;
  const auto d_a = [&](int o, int c) {
    const double in = l == 0 && c < all.params.scaled_inputs ? all.params.input_scale : 1.0;
    return from[o * stride + c] * in;
  };
  float largest = 0;
  for (int i = thread; i < size; i += kLayerThreads) largest = fmaxf(largest, fabsf(weight[i]));
  const double scale = LargestOverBlock(largest, float_scratch);
  double sigma_part = 0, inner_part = 0;
  for (int i = thread; i < size && scale > 0; i += kLayerThreads) {
    const int o = i / inputs, c = i % inputs;
    const double x = weight[i] / scale;
    sigma_part += u[o] * x * v[c];
    inner_part += d_a(o, c) * x;
  }
  const double sigma = SumOverBlock(sigma_part, scratch);
  const double inner = sigma > 0 ? SumOverBlock(inner_part, scratch) / sigma : 0.0;
  const double factor = sigma > 0 ? Squareplus(k) / sigma / scale : 0.0;
  float* to = all.gradient + all.shape.parameters[l];
  const auto give = [&](int i, double value) {
    to[i] = static_cast<float>(value);
    if (!(fabsf(to[i]) < kLargestGradient)) *all.not_finite = 1;
  };
  for (int i = thread; i < size; i += kLayerThreads) {
    const int o = i / inputs, c = i % inputs;
    give(i, loss_factor * factor * (d_a(o, c) - inner * u[o] * v[c]));
  }
  const bool biased = all.params.update.options.hidden_bias || l + 1 == all.shape.layers;
  if (thread < outputs)
    give(size + thread,
         biased ? loss_factor * from[all.shape.mlp_outputs[l] * stride + thread] : 0.0);
  if (thread != 0) return;
  give(size + outputs,
       all.params.update.NormGradient(k, loss_factor * SquareplusDerivative(k) * inner));
}

// See LimitBound in stylize/field/weight_update.h.
template <typename View>
__device__ void LimitBound(const View& all) {
  double bound = all.params.update.fixed_factor;
  const auto at = [&](int l) -> float& {
    return all.parameters[all.shape.parameters[l + 1] - 1];
  };
  for (int l = 0; l < all.shape.layers; ++l) bound *= Squareplus<double>(at(l));
  const double factor = all.params.update.LimitFactor(bound, all.shape.layers);
  for (int l = 0; l < all.shape.layers; ++l) at(l) *= static_cast<float>(factor);
}

// One block.
template <typename View>
__global__ void __launch_bounds__(kUpdateThreads)
    UpdateKernel(View all, DeviceLipschitz::Step step, StepStats* stats, int64_t capacity) {
  OptimizerState& state = *all.state;
  const bool made = *step.skip == 0 && state.halted == 0, bad = *all.not_finite != 0;
  const int64_t t = state.adam_steps + 1;
  const AdamOptions adam = all.params.update.adam;
  const double rate = all.params.update.Rate(state.step);
  const float forward = static_cast<float>(rate / AdamBiasCorrection(adam.beta1, t));
  const float inverse = static_cast<float>(1 / AdamBiasCorrection(adam.beta2, t));
  const int size = all.shape.parameters[all.shape.layers];
  for (int i = static_cast<int>(threadIdx.x); i < size && made && !bad; i += kUpdateThreads)
    AdamUpdate(all.gradient[i], adam.beta1, adam.beta2, adam.epsilon, forward, inverse,
               &all.parameters[i], &all.first_moment[i], &all.second_moment[i]);
  __syncthreads();
  if (threadIdx.x != 0) return;
  *all.not_finite = 0;
  if (!made) return;
  stats[state.step % capacity] = {*step.loss, *step.squared_error, *step.rays, *step.samples,
                                  *step.touched};
  ++state.step;
  if (bad) {
    ++state.rejected;
    if (++state.rejected_in_a_row == 2) state.halted = 1;
    return;
  }
  state.rejected_in_a_row = 0;
  ++state.adam_steps;
  LimitBound(all);
}

}  // namespace

void DeviceLipschitz::ActivateWeights(DeviceMlp* mlp, const int32_t* skip) {
  ActivateWeightsKernel<<<static_cast<unsigned>(shape_.layers), kLayerThreads, 0,
                          LaunchStream()>>>(GetView(), mlp->parameters(), skip);
  CheckLaunch("activate_weights");
}

void DeviceLipschitz::Update(DeviceMlp* mlp, const Step& step,
                             const DeviceBuffer<StepStats>& stats) {
  GradientKernel<<<static_cast<unsigned>(shape_.layers), kLayerThreads, 0, LaunchStream()>>>(
      GetView(), mlp->gradient().data(), step.rays);
  CheckLaunch("lipschitz_gradient");
  UpdateKernel<<<1, kUpdateThreads, 0, LaunchStream()>>>(GetView(), step, stats.data(),
                                                         stats.size());
  CheckLaunch("lipschitz_update");
  DeviceZero(mlp->gradient().data(), mlp->gradient().size() * int64_t{sizeof(double)});
}

#else

void DeviceLipschitz::ActivateWeights(DeviceMlp*, const int32_t*) {
  DeviceWait("activate_weights");
}
void DeviceLipschitz::Update(DeviceMlp*, const Step&, const DeviceBuffer<StepStats>&) {
  DeviceWait("lipschitz_update");
}

#endif

DeviceLipschitz::DeviceLipschitz(const std::vector<std::pair<int, int>>& shapes,
                                 const TrainingParams& params, const DeviceMlp& mlp)
    : params_(params), state_(1, "the optimizer's state"), not_finite_(1, "a flag") {
  REGRADE_CHECK(static_cast<int>(shapes.size()) <= kMaxLayers);
  shape_.layers = static_cast<int>(shapes.size());
  const int ends = MlpEndLanes(std::max(shapes.front().second, shapes.back().first));
  int parameters = 0, vectors = 0;
  for (int l = 0; l < shape_.layers; ++l) {
    const auto [outputs, inputs] = shapes[static_cast<size_t>(l)];
    REGRADE_CHECK(outputs <= kMlpHidden && inputs <= kMlpHidden);
    shape_.outputs[l] = outputs;
    shape_.inputs[l] = inputs;
    shape_.mlp_outputs[l] = l + 1 == shape_.layers ? ends : kMlpHidden;
    shape_.mlp_inputs[l] = l == 0 ? ends : kMlpHidden;
    shape_.mlp[l] = static_cast<int>(mlp.ParameterOffset(static_cast<size_t>(l)));
    shape_.parameters[l] = parameters;
    shape_.vectors[l] = vectors;
    parameters += outputs * (inputs + 1) + 1;
    vectors += outputs + inputs;
  }
  shape_.parameters[shape_.layers] = parameters;
  shape_.vectors[shape_.layers] = vectors;
  parameters_ = DeviceBuffer<float>(parameters, "trained weights");
  vectors_ = DeviceBuffer<float>(vectors, "singular vectors");
  first_moment_ = DeviceBuffer<float>(parameters, "moments of weights");
  second_moment_ = DeviceBuffer<float>(parameters, "moments of weights");
  gradient_ = DeviceBuffer<float>(parameters, "gradient of weights");
}

void DeviceLipschitz::CopyIn(const std::vector<float>& parameters,
                             const std::vector<float>& vectors, const AdamState& adam,
                             int64_t step, int32_t rejected_in_a_row) {
  REGRADE_CHECK_EQ(static_cast<int64_t>(parameters.size()), parameters_.size());
  REGRADE_CHECK_EQ(static_cast<int64_t>(vectors.size()), vectors_.size());
  parameters_.CopyIn(parameters.data(), parameters_.size());
  vectors_.CopyIn(vectors.data(), vectors_.size());
  first_moment_.Zero();
  second_moment_.Zero();
  gradient_.Zero();
  not_finite_.Zero();
  if (!adam.first_moment.empty()) {
    first_moment_.CopyIn(adam.first_moment.data(), first_moment_.size());
    second_moment_.CopyIn(adam.second_moment.data(), second_moment_.size());
  }
  OptimizerState state;
  state.step = step;
  state.adam_steps = adam.steps;
  state.rejected = adam.rejected;
  state.rejected_in_a_row = rejected_in_a_row;
  state_.CopyIn(&state, 1);
}

OptimizerState DeviceLipschitz::CopyOut(std::vector<float>* parameters,
                                        std::vector<float>* vectors, AdamState* adam) const {
  OptimizerState state;
  state_.CopyOut(&state, 1);
  const size_t size = static_cast<size_t>(parameters_.size());
  parameters->resize(size);
  vectors->resize(static_cast<size_t>(vectors_.size()));
  parameters_.CopyOut(parameters->data(), parameters_.size());
  vectors_.CopyOut(vectors->data(), vectors_.size());
  adam->steps = state.adam_steps;
  adam->rejected = state.rejected;
  if (state.adam_steps == 0) return state;
  adam->first_moment.resize(size);
  adam->second_moment.resize(size);
  first_moment_.CopyOut(adam->first_moment.data(), first_moment_.size());
  second_moment_.CopyOut(adam->second_moment.data(), second_moment_.size());
  return state;
}

std::vector<float> DeviceLipschitz::Gradient() const {
  std::vector<float> gradient(static_cast<size_t>(gradient_.size()));
  gradient_.CopyOut(gradient.data(), gradient_.size());
  return gradient;
}

}  // namespace regrade
