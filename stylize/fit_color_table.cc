#include "stylize/fit_color_table.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

using Values = std::vector<double>;  // of one channel, at each vertex

double DotProduct(const Values& a, const Values& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// The matrix of the normal equations.
struct NormalEquations {
  int size;
  double lambda;
  const std::vector<TableStencil>& stencils;

  Values Times(const Values& x) const {
    Values y(x.size());
    for (const TableStencil& stencil : stencils) {
      double value = 0;
      for (int i = 0; i < 4; ++i) value += stencil.weight[i] * x[stencil.vertex[i]];
      for (int i = 0; i < 4; ++i) y[stencil.vertex[i]] += stencil.weight[i] * value;
    }
    const size_t n = static_cast<size_t>(size), steps[3] = {1, n, n * n};
    for (size_t i = 0; i < x.size(); ++i) {
      const size_t place[3] = {i % n, i / n % n, i / (n * n)};
      for (int a = 0; a < 3; ++a) {
        if (place[a] + 1 == n) continue;
        const size_t next = i + steps[a];
        const double difference = lambda * (x[i] - x[next]);
        y[i] += difference;
        y[next] -= difference;
      }
    }
    return y;
  }
};

// Conjugate gradients, from zero.
Values SolveFor(const NormalEquations& matrix, const Values& right) {
  constexpr int kMostSteps = 100;
  constexpr double kResidual = 1e-4;  // of the right side
  Values x(right.size()), r = right, p = right;
  double squared = DotProduct(r, r);
  const double enough = kResidual * kResidual * squared;
  for (int step = 0; step < kMostSteps && squared > enough; ++step) {
    const Values ap = matrix.Times(p);
    const double length = squared / DotProduct(p, ap);
    for (size_t i = 0; i < x.size(); ++i) {
      x[i] += length * p[i];
      r[i] -= length * ap[i];
    }
    const double next = DotProduct(r, r);
    for (size_t i = 0; i < x.size(); ++i) p[i] = r[i] + next / squared * p[i];
    squared = next;
  }
  return x;
}

}  // namespace

TableFit::TableFit(int size) : size_(size) { REGRADE_CHECK(size >= 2); }

void TableFit::Add(const Vec3d& source, const Vec3d& target) {
  sources_.push_back(source);
  targets_.push_back(target);
  linear_.Add(source, target);
}

ColorTable TableFit::Solve(double smoothness) const {
  const ColorMap linear = linear_.Solve();
  ColorTable table = TabulateColors(size_, linear);
  std::vector<TableStencil> stencils;
  stencils.reserve(sources_.size());
  for (const Vec3d& source : sources_) stencils.push_back(StencilOf(table, source));
  const double vertices = static_cast<double>(table.values.size());
  const NormalEquations matrix{
      size_, smoothness * std::max<double>(1, static_cast<double>(sources_.size())) / vertices,
      stencils};
  for (int c = 0; c < 3; ++c) {
    Values right(table.values.size());
    for (size_t k = 0; k < sources_.size(); ++k) {
      const double missing = targets_[k][c] - linear(sources_[k])[c];
      for (int i = 0; i < 4; ++i)
        right[stencils[k].vertex[i]] += stencils[k].weight[i] * missing;
    }
    const Values more = SolveFor(matrix, right);
    for (size_t i = 0; i < table.values.size(); ++i)
      table.values[i][c] =
          static_cast<float>(std::clamp(double{table.values[i][c]} + more[i], 0.0, 1.0));
  }
  return table;
}

}  // namespace regrade
