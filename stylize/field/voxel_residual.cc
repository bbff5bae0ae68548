#include "stylize/field/voxel_residual.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "stylize/field/residual_quadratic.h"

namespace regrade {
namespace {

using Colors = std::vector<Vec3d>;

constexpr int64_t kBlock = 8192;  // of sums, so that they do not depend on the threads

double Product(const Colors& a, const Colors& b) {
  const int64_t n = std::ssize(a), blocks = (n + kBlock - 1) / kBlock;
  std::vector<double> sums(static_cast<size_t>(blocks));
#pragma omp parallel for schedule(static)
  for (int64_t k = 0; k < blocks; ++k)
    for (int64_t i = k * kBlock; i < std::min(n, (k + 1) * kBlock); ++i)
      sums[static_cast<size_t>(k)] += Dot(a[static_cast<size_t>(i)], b[static_cast<size_t>(i)]);
  double sum = 0;
  for (const double s : sums) sum += s;
  return sum;
}

// x + y f
Colors Sum(Colors x, const Colors& y, double f) {
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < std::ssize(x); ++v)
    x[static_cast<size_t>(v)] += y[static_cast<size_t>(v)] * f;
  return x;
}

Colors Within(const ResidualBounds& bounds, Colors x) {
  for (size_t v = 0; v < bounds.least.size(); ++v)
    for (int c = 0; c < 3; ++c)
      x[v][c] = std::clamp(x[v][c], bounds.least[v][c], bounds.most[v][c]);
  return x;
}

// The channels that are at a bound from which the energy falls outwards: they stay there.
class Held {
 public:
  Held(const ResidualBounds& bounds, const Colors& x, const Colors& descent)
      : channels_(bounds.least.size()) {
    for (size_t v = 0; v < channels_.size(); ++v)
      for (int c = 0; c < 3; ++c)
        channels_[v][c] = (x[v][c] <= bounds.least[v][c] && descent[v][c] < 0) ||
                          (x[v][c] >= bounds.most[v][c] && descent[v][c] > 0);
  }

  Colors Without(Colors x) const {
    for (size_t v = 0; v < channels_.size(); ++v)
      for (int c = 0; c < 3; ++c)
        if (channels_[v][c]) x[v][c] = 0;
    return x;
  }

 private:
  std::vector<std::array<bool, 3>> channels_;
};

// x + step, or as much of it, between the bounds, as lowers the quadratic.
Colors StepWithin(const ResidualBounds& bounds, const ResidualQuadratic& quadratic,
                  const Colors& x, const Colors& descent, const Colors& step) {
  if (bounds.least.empty()) return Sum(x, step, 1);
  constexpr int kHalvings = 4;
  for (int k = 0; k < kHalvings; ++k) {
    Colors next = Within(bounds, Sum(x, step, std::ldexp(1.0, -k)));
    const Colors moved = Sum(next, x, -1);
    if (Product(moved, quadratic.Apply(moved)) < 2 * Product(moved, descent)) return next;
  }
  return x;
}

double ColorBefore(const Appearance& appearance, size_t voxel, int channel) {
  return 0.5 + kSh0 * double{appearance.sh[static_cast<int64_t>(voxel) * appearance.stride() +
                                           channel * appearance.basis]};
}

}  // namespace

double ResidualEnergy(const VoxelGraph& graph, const ResidualRays& rays,
                      const ResidualOptions& options, const std::vector<Vec3d>& x,
                      std::vector<Vec3d>* gradient) {
  const Colors seen = SumAlongRays(rays, x);
  double energy = 0;
  for (size_t r = 0; r < rays.missing.size(); ++r) {
    const Vec3d error = seen[r] - rays.missing[r].Cast<double>();
    const double share = double{rays.share[r]};
    energy += share * Dot(error, error);
    if (gradient == nullptr) continue;
    for (int64_t i = rays.first[r]; i < rays.first[r + 1]; ++i)
      (*gradient)[static_cast<size_t>(rays.voxel[static_cast<size_t>(i)])] +=
          error * (2 * share * double{rays.weight[static_cast<size_t>(i)]});
  }
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const size_t u = static_cast<size_t>(graph.edges[e][0]),
                 v = static_cast<size_t>(graph.edges[e][1]);
    const Vec3d d = x[u] - x[v];
    const double root = std::sqrt(Dot(d, d) + options.width * options.width);
    const double cost = 2 * options.cost * double{graph.likeness[e]};
    energy += cost * (root - options.width);
    if (gradient == nullptr) continue;
    (*gradient)[u] += d * (cost / root);
    (*gradient)[v] += d * (-cost / root);
  }
  for (size_t v = 0; v < x.size(); ++v) {
    energy += options.pull * Dot(x[v], x[v]);
    if (gradient != nullptr) (*gradient)[v] += x[v] * (2 * options.pull);
  }
  return energy;
}

std::vector<Vec3d> FitResidual(const VoxelGraph& graph, const ResidualRays& rays,
                               const ResidualOptions& options, const ResidualBounds& bounds,
                               std::vector<Vec3d> start, const ProgressFunction& progress) {
  Colors x = std::move(start);
  x.resize(static_cast<size_t>(graph.voxels));
  x = Within(bounds, std::move(x));
  Colors missing;
  for (const Vec3f& t : rays.missing) missing.push_back(t.Cast<double>());
  ResidualQuadratic quadratic(graph, rays, options.pull);
  const Colors right = quadratic.Adjoint(missing);
  double enough = 0;
  for (int turn = 0; turn < options.turns; ++turn) {
    quadratic.TouchAt(x, options.cost, options.width);
    const Colors descent = Sum(right, quadratic.Apply(x), -1);
    const Held held(bounds, x, descent);
    Colors r = held.Without(descent), z = held.Without(quadratic.Precondition(r)), p = z;
    Colors step(x.size());
    double rz = Product(r, z);
    if (turn == 0) enough = 1e-12 * rz;
    for (int k = 0; k < options.steps && rz > enough; ++k) {
      ReportOrThrow(progress, turn * options.steps + k, options.turns * options.steps,
                    "residual by voxel");
      const Colors q = quadratic.Apply(p);
      const double along = Product(p, q);
      if (!(along > 0)) break;
      step = Sum(std::move(step), p, rz / along);
      r = Sum(std::move(r), held.Without(q), -rz / along);
      z = held.Without(quadratic.Precondition(r));
      const double next = Product(r, z);
      p = Sum(z, p, next / rz);
      rz = next;
    }
    x = StepWithin(bounds, quadratic, x, descent, step);
  }
  return x;
}

std::vector<Vec3f> ViewScale(const Appearance& appearance, const std::vector<Vec3d>& color) {
  constexpr double kDark = 0.02;
  std::vector<Vec3f> scale(color.size());
  for (size_t v = 0; v < color.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      const double before = std::max(ColorBefore(appearance, v, c), kDark);
      scale[v][c] = static_cast<float>(std::clamp(1 + color[v][c] / before, 0.0, 1.0));
    }
  return scale;
}

ResidualBounds BoundsOfColors(const Appearance& appearance) {
  ResidualBounds bounds;
  const size_t voxels = static_cast<size_t>(appearance.sh.size() / appearance.stride());
  bounds.least.resize(voxels), bounds.most.resize(voxels);
  for (size_t v = 0; v < voxels; ++v)
    for (int c = 0; c < 3; ++c) {
      const double color = ColorBefore(appearance, v, c);
      bounds.least[v][c] = std::min(0.0, -color);
      bounds.most[v][c] = std::max(0.0, 1 - color);
    }
  return bounds;
}

void AddResidual(const VoxelResidual& residual, Appearance* appearance) {
  const int basis = appearance->basis;
  REGRADE_CHECK_EQ(std::ssize(residual.color) * appearance->stride(), appearance->sh.size());
  for (size_t v = 0; v < residual.color.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      float* const sh =
          appearance->sh.data() + static_cast<int64_t>(v) * appearance->stride() + c * basis;
      sh[0] += residual.color[v][c] / static_cast<float>(kSh0);
      for (int k = 1; k < basis && !residual.view_scale.empty(); ++k)
        sh[k] *= residual.view_scale[v][c];
    }
}

}  // namespace regrade
