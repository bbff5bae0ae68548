// A derivative by differences, for tests of gradients.
#pragma once

namespace regrade::testing {

// Central differences with one Richardson step: error O(h^4).
template <typename F>
double Derivative(const F& f, double x, double h) {
  const auto central = [&](double step) { return (f(x + step) - f(x - step)) / (2 * step); };
  return (4 * central(h / 2) - central(h)) / 3;
}

}  // namespace regrade::testing
