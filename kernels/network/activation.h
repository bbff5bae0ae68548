// The activations of a Lipschitz network: value, derivative and Lipschitz constant.
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"

namespace regrade {

enum class Activation { kSine, kRelu, kLeakyRelu, kSigmoid, kTanh };

inline constexpr double kLeakySlope = 0.01;  // PyTorch's default

// sin(omega x) for kSine; `omega` is ignored by the others.
template <typename T>
HD T Activate(Activation activation, T omega, T x) {
  using std::exp, std::sin, std::tanh;
  switch (activation) {
    case Activation::kSine:
      return sin(omega * x);
    case Activation::kRelu:
      return x > 0 ? x : T(0);
    case Activation::kLeakyRelu:
      return x > 0 ? x : T(kLeakySlope) * x;
    case Activation::kSigmoid:
      return 1 / (1 + exp(-x));
    case Activation::kTanh:
      return tanh(x);
  }
  return x;
}

// At the kink of the two rectifiers: the left derivative, as in PyTorch.
template <typename T>
HD T ActivateDerivative(Activation activation, T omega, T x) {
  using std::cos, std::exp, std::tanh;
  switch (activation) {
    case Activation::kSine:
      return omega * cos(omega * x);
    case Activation::kRelu:
      return x > 0 ? T(1) : T(0);
    case Activation::kLeakyRelu:
      return x > 0 ? T(1) : T(kLeakySlope);
    case Activation::kSigmoid: {
      const T y = 1 / (1 + exp(-x));
      return y * (1 - y);
    }
    case Activation::kTanh: {
      const T y = tanh(x);
      return 1 - y * y;
    }
  }
  return T(1);
}

// Smallest constant valid for every x (H44: omega multiplies the bound once a layer).
inline double ActivationLipschitz(Activation activation, double omega) {
  switch (activation) {
    case Activation::kSine:
      return std::abs(omega);
    case Activation::kSigmoid:
      return 0.25;
    default:
      return 1.0;
  }
}

}  // namespace regrade
