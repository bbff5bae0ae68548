// The residual by voxel: its energy, its neighbours, and what places that no ray sees get.
#include "stylize/field/voxel_residual.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/spherical_harmonics.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

// A uniform grid of n^3 voxels, all stored but `hole`, grey; x below `dark` is black.
RadianceField Block(int n, int dark = 0, int hole = -1) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = {n, n, n};
  geometry->links.Resize(geometry->frame.NumVertices());
  int32_t next = 0;
  for (int64_t v = 0; v < geometry->links.size(); ++v)
    geometry->links[v] = v == hole ? -1 : next++;
  geometry->density.Resize(next);
  for (int32_t v = 0; v < next; ++v) geometry->density[v] = 50;
  RadianceField field;
  field.appearance.basis = 1;
  field.appearance.sh.Resize(3 * int64_t{next});
  for (int64_t v = 0; v < geometry->links.size(); ++v)
    for (int c = 0; geometry->links[v] >= 0 && c < 3; ++c)
      field.appearance.sh[3 * int64_t{geometry->links[v]} + c] =
          v / (n * n) < dark ? static_cast<float>(-0.5 / kSh0) : 0.0f;
  field.geometry = std::move(geometry);
  return field;
}

// Rays that see up to four of the first `voxels` each.
ResidualRays SomeRays(const VoxelGraph& graph, int rays, int64_t voxels, uint64_t seed) {
  ResidualRays result;
  for (int r = 0; r < rays; ++r) {
    std::vector<int32_t> row;
    for (uint64_t k = 0; k < 4; ++k)
      row.push_back(static_cast<int32_t>(
          RandomIndex(seed, static_cast<uint64_t>(r), k, static_cast<uint64_t>(voxels))));
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    for (const int32_t v : row) {
      result.voxel.push_back(v);
      result.weight.push_back(0.25f);
    }
    result.first.push_back(std::ssize(result.voxel));
    const auto random = [&](uint64_t k) {
      return static_cast<float>(RandomDouble(seed + 1, static_cast<uint64_t>(r), k) - 0.5);
    };
    result.missing.push_back({random(0), random(1), random(2)});
    result.share.push_back(1 + static_cast<float>(r % 3));
  }
  EXPECT_LE(voxels, graph.voxels);
  return result;
}

std::vector<Vec3d> RandomColors(int64_t count, double scale, uint64_t seed) {
  std::vector<Vec3d> x(static_cast<size_t>(count));
  for (size_t v = 0; v < x.size(); ++v)
    for (int c = 0; c < 3; ++c)
      x[v][c] = scale * (RandomDouble(seed, v, static_cast<uint64_t>(c)) - 0.5);
  return x;
}

TEST(VoxelResidual, AGridsNeighboursAreTheNextVoxels) {
  const int n = 4;
  const VoxelGraph whole = GraphOf(Block(n));
  EXPECT_EQ(std::ssize(whole.edges), 3 * n * n * (n - 1));
  // A vertex inside has six neighbours.
  const VoxelGraph graph = GraphOf(Block(n, 0, (1 * n + 1) * n + 1));
  EXPECT_EQ(std::ssize(graph.edges), 3 * n * n * (n - 1) - 6);
  for (const auto& edge : graph.edges) EXPECT_LT(edge[0], edge[1]);
  EXPECT_EQ(std::ssize(graph.edge_of), 2 * std::ssize(graph.edges));
  ASSERT_EQ(graph.cubes.size(), 6u);
  // 2^3 cubes of side 2, then one.
  EXPECT_EQ(*std::max_element(graph.cubes[0].begin(), graph.cubes[0].end()), 7);
  EXPECT_EQ(*std::max_element(graph.cubes[1].begin(), graph.cubes[1].end()), 0);
}

TEST(VoxelResidual, GradientIsTheEnergysDerivativeInDouble) {
  const VoxelGraph graph = GraphOf(Block(4, 2));
  const ResidualRays rays = SomeRays(graph, 40, graph.voxels, 3);
  ResidualOptions options{.pull = 0.01};
  const std::vector<Vec3d> x = RandomColors(graph.voxels, 0.1, 5),
                           along = RandomColors(graph.voxels, 1, 6);
  std::vector<Vec3d> gradient(x.size());
  ResidualEnergy(graph, rays, options, x, &gradient);
  double expected = 0;
  for (size_t v = 0; v < x.size(); ++v) expected += Dot(gradient[v], along[v]);
  const auto at = [&](double h) {
    std::vector<Vec3d> moved = x;
    for (size_t v = 0; v < x.size(); ++v) moved[v] += along[v] * h;
    return ResidualEnergy(graph, rays, options, moved, nullptr);
  };
  const double h = 1e-4, coarse = (at(h) - at(-h)) / (2 * h),
               fine = (at(h / 2) - at(-h / 2)) / h, derivative = (4 * fine - coarse) / 3;
  const double error = std::abs(derivative / expected - 1);
  // Richardson's difference of an energy of about 50 in steps of 1e-4.
  EXPECT_LE(error, testing::RecordBound("gradient of the residual's energy, relative",
                                        testing::Computed::kDouble, error, 1e-8));
}

TEST(VoxelResidual, TheFitEndsWhereTheGradientIsZero) {
  const VoxelGraph graph = GraphOf(Block(6, 3));
  const ResidualRays rays = SomeRays(graph, 150, graph.voxels, 7);
  ResidualOptions options;
  options.turns = 60, options.steps = 100;
  const std::vector<Vec3d> x = FitResidual(graph, rays, options, {});
  const auto norm = [&](const std::vector<Vec3d>& at) {
    std::vector<Vec3d> gradient(at.size());
    ResidualEnergy(graph, rays, options, at, &gradient);
    double sum = 0;
    for (const Vec3d& g : gradient) sum += Dot(g, g);
    return std::sqrt(sum);
  };
  const double left = norm(x) / norm(std::vector<Vec3d>(x.size()));
  EXPECT_LE(left, testing::RecordBound("gradient left of the start's",
                                       testing::Computed::kDouble, left, 1e-3));
  // Few turns, as by default, are near: each touches the energy from above.
  ResidualOptions few;
  const auto energy = [&](const std::vector<Vec3d>& at) {
    return ResidualEnergy(graph, rays, options, at, nullptr);
  };
  const double least = energy(x), nothing = energy(std::vector<Vec3d>(x.size())),
               quick = energy(FitResidual(graph, rays, few, {}));
  EXPECT_LT(least, quick + 1e-9);
  EXPECT_LE(quick - least, 0.05 * (nothing - least));
}

TEST(VoxelResidual, ColorsStayBetweenBlackAndWhiteAndTheRestIsAtItsLeast) {
  const RadianceField field = Block(6, 3);
  const VoxelGraph graph = GraphOf(field);
  ResidualRays rays = SomeRays(graph, 150, graph.voxels, 7);
  for (Vec3f& missing : rays.missing) missing = missing * 4.0f;
  const ResidualOptions options{.turns = 60, .steps = 100};
  const ResidualBounds bounds = BoundsOfColors(field.appearance);
  const std::vector<Vec3d> x = FitResidual(graph, rays, options, bounds);
  std::vector<Vec3d> gradient(x.size()), at_start(x.size());
  ResidualEnergy(graph, rays, options, x, &gradient);
  ResidualEnergy(graph, rays, options, std::vector<Vec3d>(x.size()), &at_start);
  double squared = 0, of_start = 0;
  int least = 0, most = 0;
  for (size_t v = 0; v < x.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      ASSERT_GE(x[v][c], bounds.least[v][c]);
      ASSERT_LE(x[v][c], bounds.most[v][c]);
      double g = gradient[v][c];
      if (x[v][c] == bounds.least[v][c]) g = std::min(g, 0.0), ++least;
      if (x[v][c] == bounds.most[v][c]) g = std::max(g, 0.0), ++most;
      squared += g * g, of_start += at_start[v][c] * at_start[v][c];
    }
  EXPECT_GT(least, 20);
  EXPECT_GT(most, 20);
  const double left = std::sqrt(squared / of_start);
  EXPECT_LE(left, testing::RecordBound("gradient left of the start's, with bounds",
                                       testing::Computed::kDouble, left, 1e-3));
}

TEST(VoxelResidual, UnseenPlacesFollowNeighboursOfLikeColour) {
  // Rays see the last layer of the grey half: +0.2 red. Nobody sees the rest.
  const int n = 12, dark = 6;
  const VoxelGraph graph = GraphOf(Block(n, dark));
  ResidualRays rays;
  const auto voxel = [n](int x, int y, int z) { return (x * n + y) * n + z; };
  for (int y = 0; y < n; ++y)
    for (int z = 0; z < n; ++z)
      for (const auto& [x, missing] : {std::pair{n - 1, 0.2f}, std::pair{0, 0.0f}}) {
        rays.voxel.push_back(voxel(x, y, z));
        rays.weight.push_back(1);
        rays.first.push_back(std::ssize(rays.voxel));
        rays.missing.push_back({missing, 0, 0});
        rays.share.push_back(1);
      }
  const std::vector<Vec3d> x = FitResidual(graph, rays, {}, {});
  const auto red = [&](int at) { return x[static_cast<size_t>(voxel(at, n / 2, n / 2))].x; };
  EXPECT_NEAR(red(n - 1), 0.2, 0.02);
  EXPECT_NEAR(red(dark), 0.2, 0.02) << "unseen, of like colour";
  EXPECT_NEAR(red(dark - 1), 0, 0.02) << "of another colour";
  EXPECT_NEAR(x[static_cast<size_t>(voxel(dark, 2, 3))].y, 0, 1e-6);
}

TEST(VoxelResidual, DoesNotDependOnTheThreads) {
  const VoxelGraph graph = GraphOf(Block(8, 3));
  const ResidualRays rays = SomeRays(graph, 300, graph.voxels, 9);
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const std::vector<Vec3d> one = FitResidual(graph, rays, {}, {});
  omp_set_num_threads(3);
  const std::vector<Vec3d> three = FitResidual(graph, rays, {}, {});
  omp_set_num_threads(threads);
  for (size_t v = 0; v < one.size(); ++v) ASSERT_TRUE(one[v] == three[v]) << v;
}

TEST(VoxelResidual, RaysSeeWhatTheRendererSees) {
  RadianceField field = Block(6);
  Camera camera = testing::PinholeOf(12, 8, 14);
  camera.camera_from_world.translation = {0.1, -0.05, 3};
  ResidualRays rays;
  AddResidualRays(field, camera, Image(12, 8), 1 << 20, 0, &rays);
  ASSERT_EQ(rays.num_rays(), 12 * 8);
  const std::vector<Vec3d> x = RandomColors(field.geometry->num_voxels(), 0.2, 2);
  std::vector<Vec3f> colors;
  for (const Vec3d& v : x) colors.push_back(v.Cast<float>());
  const Image before = RenderView(field, camera, field.march).color;
  AddResidual({colors, {}}, &field.appearance);
  const Image after = RenderView(field, camera, field.march).color;
  const std::vector<Vec3d> seen = SumAlongRays(rays, x);
  double largest = 0, error = 0;
  for (int64_t i = 0; i < before.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c) {
      const double change = double{after.pixels[3 * i + c]} - double{before.pixels[3 * i + c]};
      largest = std::max(largest, std::abs(change));
      error = std::max(error, std::abs(change - seen[static_cast<size_t>(i)][c]));
    }
  EXPECT_GT(largest, 0.03);
  // Samples of a weight up to 1e-4 are left out.
  EXPECT_LE(error, 1e-3);
  Image missing(12, 8);
  missing.pixels[3] = std::nanf("");
  ResidualRays known;
  AddResidualRays(field, camera, missing, 1 << 20, 0, &known);
  EXPECT_EQ(known.num_rays(), 12 * 8 - 1);
  // Fewer rays stand for all.
  ResidualRays few;
  AddResidualRays(field, camera, Image(12, 8), 48, 1, &few);
  EXPECT_LT(few.num_rays(), 80);
  EXPECT_NEAR(few.share[0], 2, 1e-6);
}

TEST(VoxelResidual, WhatChangesWithTheViewKeepsItsProportionAndNeverGrows) {
  Appearance appearance;
  appearance.basis = 4;
  appearance.sh.Resize(12);
  for (int c = 0; c < 3; ++c) {
    appearance.sh[4 * c] = static_cast<float>(0.3 / kSh0);  // 0.8 of white
    for (int k = 1; k < 4; ++k) appearance.sh[4 * c + k] = 0.1f;
  }
  // Darker by half, lighter, and below black.
  const std::vector<Vec3d> x{{-0.4, 0.1, -0.9}};
  const std::vector<Vec3f> scale = ViewScale(appearance, x);
  EXPECT_NEAR(scale[0].x, 0.5, 1e-6);
  EXPECT_EQ(scale[0].y, 1);
  EXPECT_EQ(scale[0].z, 0);
  AddResidual({{x[0].Cast<float>()}, scale}, &appearance);
  EXPECT_NEAR(appearance.sh[0] * kSh0, -0.1, 1e-6);
  EXPECT_NEAR(appearance.sh[1], 0.05, 1e-6);
  EXPECT_NEAR(appearance.sh[7], 0.1, 1e-6);
  EXPECT_EQ(appearance.sh[11], 0);
  // What is darker than black, and is not edited, keeps all of it.
  appearance.sh[0] = static_cast<float>(-0.6 / kSh0);
  EXPECT_EQ(ViewScale(appearance, {{0, 0, 0}})[0].x, 1);
}

}  // namespace
}  // namespace regrade
