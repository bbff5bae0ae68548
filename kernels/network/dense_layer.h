// A dense network for any scalar: the plain specification of the fused path.
//
// EQ(mlp): x_0 = input, x_l = act(A_l x_{l-1} + b_l) for all but the last layer, which has no
// activation; the adjoint is the chain rule, layer by layer.
#pragma once

#include <vector>

#include "kernels/network/activation.h"

namespace regrade {

template <typename T>
struct DenseLayer {
  int outputs = 0, inputs = 0;
  std::vector<T> weight;  // A [outputs, inputs]
  std::vector<T> bias;    // [outputs]

  DenseLayer() = default;
  DenseLayer(int outputs, int inputs)
      : outputs(outputs),
        inputs(inputs),
        weight(static_cast<size_t>(outputs) * inputs),
        bias(static_cast<size_t>(outputs)) {}
};

template <typename T>
struct DenseNetwork {
  Activation activation = Activation::kSine;
  T omega = 1;
  std::vector<DenseLayer<T>> layers;
};

// One input. `x` [inputs of the first layer] -> `y` [outputs of the last]. Instantiated for
// float and double.
template <typename T>
void DenseForward(const DenseNetwork<T>& network, const T* x, T* y);

// Adds dL/dA_l and dL/db_l to `gradient`, which has the network's shape; `d_x` [inputs] (may be
// null) is overwritten with dL/dx.
template <typename T>
void DenseAdjoint(const DenseNetwork<T>& network, const T* x, const T* d_y,
                  DenseNetwork<T>* gradient, T* d_x);

}  // namespace regrade
