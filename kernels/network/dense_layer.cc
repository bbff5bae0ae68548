#include "kernels/network/dense_layer.h"

namespace regrade {
namespace {

// before[l] is the input of layer l's activation, x[l] the input of the layer.
template <typename T>
void Trace(const DenseNetwork<T>& network, const T* input, std::vector<std::vector<T>>* x,
           std::vector<std::vector<T>>* before) {
  std::vector<T> current(input, input + network.layers.front().inputs);
  for (size_t l = 0; l < network.layers.size(); ++l) {
    const DenseLayer<T>& layer = network.layers[l];
    std::vector<T> sum(layer.bias);
    for (int o = 0; o < layer.outputs; ++o)
      for (int i = 0; i < layer.inputs; ++i)
        sum[o] += layer.weight[static_cast<size_t>(o) * layer.inputs + i] * current[i];
    x->push_back(current);
    before->push_back(sum);
    if (l + 1 < network.layers.size())
      for (T& value : sum) value = Activate(network.activation, network.omega, value);
    current = std::move(sum);
  }
}

}  // namespace

template <typename T>
void DenseForward(const DenseNetwork<T>& network, const T* x, T* y) {
  std::vector<std::vector<T>> inputs, before;
  Trace(network, x, &inputs, &before);
  for (const T value : before.back()) *y++ = value;
}

template <typename T>
void DenseAdjoint(const DenseNetwork<T>& network, const T* x, const T* d_y,
                  DenseNetwork<T>* gradient, T* d_x) {
  std::vector<std::vector<T>> inputs, before;
  Trace(network, x, &inputs, &before);
  std::vector<T> d_sum(d_y, d_y + network.layers.back().outputs);
  for (size_t l = network.layers.size(); l-- > 0;) {
    const DenseLayer<T>& layer = network.layers[l];
    std::vector<T> d_input(layer.inputs);
    for (int o = 0; o < layer.outputs; ++o) {
      gradient->layers[l].bias[o] += d_sum[o];
      for (int i = 0; i < layer.inputs; ++i) {
        const size_t at = static_cast<size_t>(o) * layer.inputs + i;
        gradient->layers[l].weight[at] += d_sum[o] * inputs[l][i];
        d_input[i] += d_sum[o] * layer.weight[at];
      }
    }
    if (l > 0)
      for (int i = 0; i < layer.inputs; ++i)
        d_input[i] *= ActivateDerivative(network.activation, network.omega, before[l - 1][i]);
    d_sum = std::move(d_input);
  }
  if (d_x != nullptr)
    for (const T value : d_sum) *d_x++ = value;
}

template void DenseForward(const DenseNetwork<float>&, const float*, float*);
template void DenseForward(const DenseNetwork<double>&, const double*, double*);
template void DenseAdjoint(const DenseNetwork<float>&, const float*, const float*,
                           DenseNetwork<float>*, float*);
template void DenseAdjoint(const DenseNetwork<double>&, const double*, const double*,
                           DenseNetwork<double>*, double*);

}  // namespace regrade
