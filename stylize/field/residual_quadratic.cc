#include "stylize/field/residual_quadratic.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

using Colors = std::vector<Vec3d>;

}  // namespace

ResidualQuadratic::ResidualQuadratic(const VoxelGraph& graph, const ResidualRays& rays,
                                     double pull)
    : graph_(graph),
      rays_(rays),
      pull_(pull),
      first_(static_cast<size_t>(graph.voxels) + 1),
      ray_(rays.voxel.size()),
      weight_(rays.voxel.size()) {
  for (const int32_t v : rays.voxel) ++first_[static_cast<size_t>(v) + 1];
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  std::vector<int64_t> next(first_.begin(), first_.end() - 1);
  for (size_t r = 0; r < rays.missing.size(); ++r)
    for (int64_t i = rays.first[r]; i < rays.first[r + 1]; ++i) {
      const size_t from = static_cast<size_t>(i);
      const size_t to = static_cast<size_t>(next[static_cast<size_t>(rays.voxel[from])]++);
      ray_[to] = static_cast<int32_t>(r);
      weight_[to] = rays.weight[from];
    }
  for (size_t level = 0; level + 1 < graph.cubes.size(); ++level) {
    const std::vector<int32_t>&cube = graph.cubes[level], &wider = graph.cubes[level + 1];
    std::vector<int32_t> parent;
    for (size_t v = 0; v < cube.size(); ++v) {
      const size_t c = static_cast<size_t>(cube[v]);
      if (parent.size() <= c) parent.resize(c + 1);
      parent[c] = wider[v];
    }
    parent_.push_back(std::move(parent));
  }
}

Colors ResidualQuadratic::Adjoint(const Colors& y) const {
  Colors x(static_cast<size_t>(graph_.voxels));
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < graph_.voxels; ++v) {
    Vec3d sum{};
    for (int64_t i = first_[static_cast<size_t>(v)]; i < first_[static_cast<size_t>(v) + 1];
         ++i) {
      const size_t r = static_cast<size_t>(ray_[static_cast<size_t>(i)]);
      sum += y[r] * (double{weight_[static_cast<size_t>(i)]} * double{rays_.share[r]});
    }
    x[static_cast<size_t>(v)] = sum;
  }
  return x;
}

void ResidualQuadratic::TouchAt(const Colors& x, double cost, double width) {
  edge_.resize(graph_.edges.size());
#pragma omp parallel for schedule(static)
  for (int64_t e = 0; e < std::ssize(graph_.edges); ++e) {
    const size_t k = static_cast<size_t>(e);
    const Vec3d d =
        x[static_cast<size_t>(graph_.edges[k][0])] - x[static_cast<size_t>(graph_.edges[k][1])];
    edge_[k] = cost * double{graph_.likeness[k]} / std::sqrt(Dot(d, d) + width * width);
  }
  FindDiagonals();
}

Colors ResidualQuadratic::Apply(const Colors& x) const {
  Colors y = Adjoint(SumAlongRays(rays_, x));
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < graph_.voxels; ++v) {
    const size_t own = static_cast<size_t>(v);
    Vec3d sum = x[own] * pull_;
    for (int64_t i = graph_.first_edge[own]; i < graph_.first_edge[own + 1]; ++i) {
      const size_t e = static_cast<size_t>(graph_.edge_of[static_cast<size_t>(i)]);
      const auto& edge = graph_.edges[e];
      const int32_t other = edge[0] == v ? edge[1] : edge[0];
      sum += (x[own] - x[static_cast<size_t>(other)]) * edge_[e];
    }
    y[own] += sum;
  }
  return y;
}

Colors ResidualQuadratic::Precondition(const Colors& r) const {
  // P^T r: a cube's sum is that of the cubes of half its width in it.
  std::vector<Colors> sums(graph_.cubes.size());
  for (size_t level = 0; level < sums.size(); ++level) {
    const Colors& finer = level == 0 ? r : sums[level - 1];
    const std::vector<int32_t>& parent = level == 0 ? graph_.cubes[0] : parent_[level - 1];
    sums[level].resize(inverse_[level + 1].size());
    for (size_t i = 0; i < finer.size(); ++i)
      sums[level][static_cast<size_t>(parent[i])] += finer[i];
  }
  // The sum over the levels, from the widest cubes on.
  for (size_t level = sums.size(); level-- > 0;) {
    Colors& own = sums[level];
    for (size_t c = 0; c < own.size(); ++c) {
      own[c] = own[c] * inverse_[level + 1][c];
      if (level + 1 < sums.size())
        own[c] += sums[level + 1][static_cast<size_t>(parent_[level][c])];
    }
  }
  Colors z(r.size());
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < graph_.voxels; ++v) {
    const size_t own = static_cast<size_t>(v);
    z[own] = r[own] * inverse_[0][own];
    if (!sums.empty()) z[own] += sums[0][static_cast<size_t>(graph_.cubes[0][own])];
  }
  return z;
}

void ResidualQuadratic::FindDiagonals() {
  const size_t voxels = static_cast<size_t>(graph_.voxels);
  // Of one voxel sum_r m W_rv^2; of a cube less than sum_r m W_rv sum_u W_ru.
  std::vector<double> square(voxels), row(voxels), seen(rays_.missing.size());
  for (size_t r = 0; r < seen.size(); ++r)
    for (int64_t i = rays_.first[r]; i < rays_.first[r + 1]; ++i)
      seen[r] += double{rays_.weight[static_cast<size_t>(i)]};
  for (size_t v = 0; v < voxels; ++v)
    for (int64_t i = first_[v]; i < first_[v + 1]; ++i) {
      const size_t r = static_cast<size_t>(ray_[static_cast<size_t>(i)]);
      const double w = double{weight_[static_cast<size_t>(i)]};
      square[v] += double{rays_.share[r]} * w * w;
      row[v] += double{rays_.share[r]} * w * seen[r];
    }
  inverse_.assign(1, std::vector<double>(voxels));
  for (size_t v = 0; v < voxels; ++v) inverse_[0][v] = square[v] + pull_;
  for (size_t e = 0; e < edge_.size(); ++e)
    for (const int32_t v : graph_.edges[e]) inverse_[0][static_cast<size_t>(v)] += edge_[e];
  for (const std::vector<int32_t>& cube : graph_.cubes) {
    const int32_t count = voxels > 0 ? *std::max_element(cube.begin(), cube.end()) + 1 : 0;
    std::vector<double> sum(static_cast<size_t>(count));
    for (size_t v = 0; v < voxels; ++v) sum[static_cast<size_t>(cube[v])] += row[v] + pull_;
    for (size_t e = 0; e < edge_.size(); ++e) {
      const int32_t a = cube[static_cast<size_t>(graph_.edges[e][0])],
                    b = cube[static_cast<size_t>(graph_.edges[e][1])];
      if (a == b) continue;
      sum[static_cast<size_t>(a)] += edge_[e];
      sum[static_cast<size_t>(b)] += edge_[e];
    }
    inverse_.push_back(std::move(sum));
  }
  for (std::vector<double>& level : inverse_)
    for (double& d : level) d = 1 / d;  // at least the pull
}

}  // namespace regrade
