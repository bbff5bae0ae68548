// A derivative by differences, for tests of gradients.
#pragma once

#include <cmath>
#include <limits>

namespace regrade::testing {

// Where the differences of a smooth function with values near 1 and steps near 1e-4 are further
// apart than this, there is a kink between them.
constexpr double kKink = 1e-6;

// Central differences with steps h and h / 2 and one Richardson step: error O(h^4). NaN if the
// two differ by more than `apart`.
template <typename F>
double Derivative(const F& f, double x, double h,
                  double apart = std::numeric_limits<double>::infinity()) {
  const auto central = [&](double step) { return (f(x + step) - f(x - step)) / (2 * step); };
  const double fine = central(h / 2), coarse = central(h);
  return std::abs(fine - coarse) > apart ? std::nan("") : (4 * fine - coarse) / 3;
}

// As Derivative, of f() by the variable *x that it reads; *x keeps its value.
template <typename F>
double DerivativeBy(double* x, const F& f, double h,
                    double apart = std::numeric_limits<double>::infinity()) {
  const double at = *x;
  const auto moved = [&](double value) {
    *x = value;
    return f();
  };
  const double derivative = Derivative(moved, at, h, apart);
  *x = at;
  return derivative;
}

}  // namespace regrade::testing
