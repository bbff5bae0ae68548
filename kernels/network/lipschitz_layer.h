// A linear layer whose spectral norm is a parameter, and its adjoint.
//
// EQ(lipschitz-layer), LipRF Sec. 5.3:  A = squareplus(K, b) W / sigma,  sigma = u^T W v, with
// u and v from the power iteration (Miyato et al. 2018), held constant in the adjoint:
//   d_W = s / sigma (d_A - <d_A, W / sigma> u v^T),   d_K = squareplus'(K) <d_A, W / sigma>.
// sigma never exceeds ||W||_2, so ||A||_2 >= squareplus(K): the certificate needs exact
// singular values (stylize/field/lipschitz_network.h). W is divided by its largest entry before
// any squaring, so that no scale of W over- or underflows.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "kernels/base/host_device.h"

namespace regrade {

inline constexpr double kSquareplusB = 1e-12;

// EQ(squareplus), Barron 2021: (x + sqrt(x^2 + b)) / 2. The textbook form cancels for x < 0 (in
// float it is exactly 0 below -0.0039 for b = 1e-12, a dead layer); this form does not.
template <typename T>
HD T Squareplus(T x, T b = T(kSquareplusB)) {
  using std::hypot, std::sqrt;
  const T r = hypot(x, sqrt(b));
  return x >= 0 ? (x + r) / 2 : b / (2 * (r - x));
}

// squareplus' = squareplus / sqrt(x^2 + b), without cancellation on either side.
template <typename T>
HD T SquareplusDerivative(T x, T b = T(kSquareplusB)) {
  using std::hypot, std::sqrt;
  const T r = hypot(x, sqrt(b));
  return r > 0 ? Squareplus(x, b) / r : T(0.5);
}

// W [outputs, inputs] by rows, and the running singular vectors u [outputs], v [inputs].
template <typename T>
struct SpectralView {
  int outputs = 0, inputs = 0;
  const T* weight = nullptr;
  T* u = nullptr;
  T* v = nullptr;
};

template <typename T>
T LargestMagnitude(const SpectralView<T>& w) {
  T largest = 0;
  for (int64_t i = 0; i < static_cast<int64_t>(w.outputs) * w.inputs; ++i)
    largest = std::max(largest, std::abs(w.weight[i]));
  return largest;
}

// Normalises `x`; returns its former length and leaves a zero vector unchanged.
template <typename T>
T NormalizeInPlace(T* x, int n) {
  T sum = 0;
  for (int i = 0; i < n; ++i) sum += x[i] * x[i];
  const T norm = std::sqrt(sum);
  if (norm > 0)
    for (int i = 0; i < n; ++i) x[i] /= norm;
  return norm;
}

// u = normalised (W / scale) v; returns the length, which is u^T (W / scale) v.
template <typename T>
T LeftFromRight(const SpectralView<T>& w, T scale) {
  for (int o = 0; o < w.outputs; ++o) {
    T sum = 0;
    for (int i = 0; i < w.inputs; ++i)
      sum += (w.weight[static_cast<int64_t>(o) * w.inputs + i] / scale) * w.v[i];
    w.u[o] = sum;
  }
  return NormalizeInPlace(w.u, w.outputs);
}

// Starts from W's longest column, so that sigma >= ||W||_F / sqrt(inputs) from the first step
// for any W: a random start can be orthogonal to the top singular vector.
template <typename T>
void StartPowerIteration(const SpectralView<T>& w) {
  std::fill_n(w.u, w.outputs, T(0));
  std::fill_n(w.v, w.inputs, T(0));
  const T scale = LargestMagnitude(w);
  if (!(scale > 0)) return;
  int longest = 0;
  T longest_sum = -1;
  for (int i = 0; i < w.inputs; ++i) {
    T sum = 0;
    for (int o = 0; o < w.outputs; ++o) {
      const T x = w.weight[static_cast<int64_t>(o) * w.inputs + i] / scale;
      sum += x * x;
    }
    if (sum > longest_sum) longest_sum = sum, longest = i;
  }
  w.v[longest] = 1;
  LeftFromRight(w, scale);
}

// One step: v from u, then u from v. Returns u^T W v / LargestMagnitude(W); 0 for W = 0.
// Restarts if u is orthogonal to the range of W.
template <typename T>
T PowerStep(const SpectralView<T>& w) {
  const T scale = LargestMagnitude(w);
  if (!(scale > 0)) return 0;
  T square = 0;
  std::fill_n(w.v, w.inputs, T(0));
  for (int o = 0; o < w.outputs; ++o)
    for (int i = 0; i < w.inputs; ++i) {
      const T x = w.weight[static_cast<int64_t>(o) * w.inputs + i] / scale;
      square += x * x;
      w.v[i] += x * w.u[o];
    }
  const T norm = NormalizeInPlace(w.v, w.inputs);
  if (!(norm > std::numeric_limits<T>::epsilon() * std::sqrt(square))) StartPowerIteration(w);
  return LeftFromRight(w, scale);
}

// Start, then steps until sigma changes by less than 1e-6 of its value (at most 200 steps): a
// single step after a random start is off by up to a factor of two.
template <typename T>
T WarmUpPowerIteration(const SpectralView<T>& w) {
  StartPowerIteration(w);
  T sigma = PowerStep(w);
  for (int step = 0; step < 200; ++step) {
    const T next = PowerStep(w);
    const bool settled = std::abs(next - sigma) <= T(1e-6) * next;
    sigma = next;
    if (settled) break;
  }
  return sigma;
}

// sigma / LargestMagnitude(W) with the current u, v.
template <typename T>
T FrozenSigma(const SpectralView<T>& w, T scale) {
  if (!(scale > 0)) return 0;
  T sigma = 0;
  for (int o = 0; o < w.outputs; ++o) {
    T sum = 0;
    for (int i = 0; i < w.inputs; ++i)
      sum += (w.weight[static_cast<int64_t>(o) * w.inputs + i] / scale) * w.v[i];
    sigma += w.u[o] * sum;
  }
  return sigma;
}

// A [outputs, inputs]. W = 0 gives A = 0.
template <typename T>
void LipschitzWeight(const SpectralView<T>& w, T k, T* a) {
  const int64_t n = static_cast<int64_t>(w.outputs) * w.inputs;
  const T scale = LargestMagnitude(w), sigma = FrozenSigma(w, scale);
  if (!(sigma > 0)) return static_cast<void>(std::fill_n(a, n, T(0)));
  const T factor = Squareplus(k) / sigma;
  for (int64_t i = 0; i < n; ++i) a[i] = factor * (w.weight[i] / scale);
}

// Adds to d_weight [outputs, inputs] and d_k the gradient for d_a [outputs, inputs]. W = 0
// contributes nothing.
template <typename T>
void LipschitzWeightAdjoint(const SpectralView<T>& w, T k, const T* d_a, T* d_weight, T* d_k) {
  const int64_t n = static_cast<int64_t>(w.outputs) * w.inputs;
  const T scale = LargestMagnitude(w), sigma = FrozenSigma(w, scale);
  if (!(sigma > 0)) return;
  T inner = 0;  // <d_A, W / sigma>
  for (int64_t i = 0; i < n; ++i) inner += d_a[i] * ((w.weight[i] / scale) / sigma);
  const T factor = Squareplus(k) / sigma / scale;
  for (int o = 0; o < w.outputs; ++o)
    for (int i = 0; i < w.inputs; ++i) {
      const int64_t at = static_cast<int64_t>(o) * w.inputs + i;
      d_weight[at] += factor * (d_a[at] - inner * w.u[o] * w.v[i]);
    }
  *d_k += SquareplusDerivative(k) * inner;
}

}  // namespace regrade
