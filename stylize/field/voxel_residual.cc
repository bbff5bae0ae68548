#include "stylize/field/voxel_residual.h"

#include <algorithm>
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
                               const ResidualOptions& options, std::vector<Vec3d> start,
                               const ProgressFunction& progress) {
  Colors x = std::move(start);
  x.resize(static_cast<size_t>(graph.voxels));
  Colors missing;
  for (const Vec3f& t : rays.missing) missing.push_back(t.Cast<double>());
  ResidualQuadratic quadratic(graph, rays, options.pull);
  const Colors right = quadratic.Adjoint(missing);
  double enough = 0;
  for (int turn = 0; turn < options.turns; ++turn) {
    quadratic.TouchAt(x, options.cost, options.width);
    Colors r = quadratic.Apply(x);
    for (size_t v = 0; v < r.size(); ++v) r[v] = right[v] - r[v];
    Colors z = quadratic.Precondition(r), p = z;
    double rz = Product(r, z);
    if (turn == 0) enough = 1e-12 * rz;
    for (int step = 0; step < options.steps && rz > enough; ++step) {
      ReportOrThrow(progress, turn * options.steps + step, options.turns * options.steps,
                    "residual by voxel");
      const Colors q = quadratic.Apply(p);
      const double along = Product(p, q);
      if (!(along > 0)) break;
      const double a = rz / along;
#pragma omp parallel for schedule(static)
      for (int64_t i = 0; i < graph.voxels; ++i) {
        const size_t v = static_cast<size_t>(i);
        x[v] += p[v] * a;
        r[v] += q[v] * -a;
      }
      z = quadratic.Precondition(r);
      const double next = Product(r, z);
#pragma omp parallel for schedule(static)
      for (int64_t i = 0; i < graph.voxels; ++i) {
        const size_t v = static_cast<size_t>(i);
        p[v] = z[v] + p[v] * (next / rz);
      }
      rz = next;
    }
  }
  return x;
}

std::vector<Vec3f> ViewScale(const Appearance& appearance, const std::vector<Vec3d>& color) {
  constexpr double kDark = 0.02;
  std::vector<Vec3f> scale(color.size());
  for (size_t v = 0; v < color.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      const double before =
          0.5 + kSh0 * double{appearance.sh[static_cast<int64_t>(v) * appearance.stride() +
                                            c * appearance.basis]};
      scale[v][c] = static_cast<float>(
          std::clamp((before + color[v][c]) / std::max(before, kDark), 0.0, 1.0));
    }
  return scale;
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
