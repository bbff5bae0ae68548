// Adaptive fields: the tree, the walk of rays through it, and the changes of cells.
#include "tests/support/cell_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cell_walk.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/refine_cells.h"
#include "kernels/field/render_ray.h"
#include "tests/support/double_field.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using testing::CellField;
using testing::DoubleField;
using testing::RandomCellField;
using testing::RandomCells;
using testing::RandomRays;
using testing::ToDouble;
using testing::TopCells;

Vec3i VoxelsOf(const RadianceField& field) { return field.geometry->frame.resolution; }

// Length of the ray inside of the frame's box beyond near_clip, in double.
double LengthInBox(const GridFrame& frame, const RayT<double>& ray, double near_clip) {
  double begin = near_clip, end = 1e30;
  for (int a = 0; a < 3; ++a) {
    const double low = double{frame.center[a]} - frame.radius[a];
    const double high = double{frame.center[a]} + frame.radius[a];
    if (ray.direction[a] == 0) {
      if (ray.origin[a] < low || ray.origin[a] >= high) return 0;
      continue;
    }
    const double t0 = (low - ray.origin[a]) / ray.direction[a];
    const double t1 = (high - ray.origin[a]) / ray.direction[a];
    begin = std::max(begin, std::min(t0, t1));
    end = std::min(end, std::max(t0, t1));
  }
  return std::max(0.0, end - begin);
}

template <typename T>
T WalkedLength(const GridFrame& frame, const CellsView& cells, const RayT<T>& ray, T near_clip,
               int* widths = nullptr) {
  T sum = 0;
  WalkCells(frame, cells, ray, near_clip, [&](const CellSample<T>& sample) {
    EXPECT_GE(sample.delta, 0);
    sum += sample.delta;
    if (widths != nullptr) *widths |= sample.width;
    return true;
  });
  return sum;
}

TEST(CellLattice, KeysKeepPlacesAndOrder) {
  const Vec3i places[] = {
      {0, 0, 0}, {1, 2, 3}, {1 << 20, 0, 1 << 20}, {12345, 999999, 1048576}};
  for (const Vec3i& at : places) EXPECT_EQ(PlaceOf(KeyOf(at)), at);
  // The eight children of a cell follow it in the order of their corners' numbers.
  for (int k = 0; k < 8; ++k)
    EXPECT_EQ(KeyOf(CornerOf({8, 16, 24}, 4, k)),
              KeyOf({8, 16, 24}) + (static_cast<CellKey>(k) << 6));
}

// Steps of one voxel, as a ray makes them, and leaps.
TEST(CellGrid, APathFindsWhatASearchFromTheTopFinds) {
  const Vec3i voxels{16, 24, 16};
  const CellGrid grid = RandomCells({2, 3, 2}, 3, 0.15, 5);
  const CellsView view = ViewOf(grid, voxels);
  std::mt19937 random(3);
  CellPath path(view);
  Vec3i at{0, 0, 0};
  for (int i = 0; i < 20000; ++i) {
    int width = 0, from_top = 0;
    EXPECT_EQ(path(at, &width), CellAt(view, at, &from_top)) << i;
    EXPECT_EQ(width, from_top) << i;
    const int a = static_cast<int>(random() % 3);
    at[a] = i % 10 == 0 ? static_cast<int>(random() % voxels[a])
                        : std::clamp(at[a] + (random() % 2 == 0 ? 1 : -1), 0, voxels[a] - 1);
  }
}

TEST(CellGrid, EveryVoxelIsFoundInItsCell) {
  const Vec3i voxels{16, 24, 16};
  const CellGrid grid = RandomCells({2, 3, 2}, 3, 0.15, 5);
  const CellsView view = ViewOf(grid, voxels);
  std::set<int> widths;
  int64_t covered = 0;
  for (int x = 0; x < voxels.x; ++x)
    for (int y = 0; y < voxels.y; ++y)
      for (int z = 0; z < voxels.z; ++z) {
        int width = 0;
        const int32_t cell = CellAt(view, {x, y, z}, &width);
        if (cell == kNoCell) continue;
        ++covered;
        widths.insert(width);
        EXPECT_EQ(width, 1 << (grid.finest - grid.level[cell]));
        EXPECT_EQ(PlaceOf(grid.key[cell]), (Vec3i{x & -width, y & -width, z & -width}));
      }
  EXPECT_EQ(widths.size(), 4u);  // all levels occur
  int64_t volume = 0;
  for (int64_t c = 0; c < grid.num_cells(); ++c)
    volume += int64_t{1} << (3 * (grid.finest - grid.level[c]));
  EXPECT_EQ(covered, volume);
  // A vertex is a place: cells of two levels share those that both have as corners.
  for (int64_t i = 0; i < grid.corner.size(); ++i)
    EXPECT_EQ(PlaceOf(grid.vertex_key[grid.corner[i]]),
              CornerOf(PlaceOf(grid.key[i / 8]), 1 << (grid.finest - grid.level[i / 8]),
                       static_cast<int>(i % 8)));
}

// The intervals' sum is the length in the box: in double to rounding, and in float to a few
// units in the last place of the box's size, at every depth of the tree. Rays include those in
// a face, along an edge, and through corners.
TEST(CellWalk, H162_NoLengthIsCountedTwiceOrLeftOutSixteenLevelsDeep) {
  for (const int finest : {0, 1, 4, 16}) {
    CellGrid grid = TopCells({2, 2, 2}, finest);
    const Vec3i voxels{2 << finest, 2 << finest, 2 << finest};
    for (int level = 0; level < finest; ++level) {
      std::vector<CellChange> change(static_cast<size_t>(grid.num_cells()), CellChange::kKeep);
      for (int64_t c = 0; c < grid.num_cells(); ++c)  // the cells about one point
        if (PlaceOf(grid.key[c]).x <= voxels.x / 3 &&
            PlaceOf(grid.key[c]).x + (1 << (finest - grid.level[c])) > voxels.x / 3 &&
            PlaceOf(grid.key[c]).y <= voxels.y / 2 &&
            PlaceOf(grid.key[c]).y + (1 << (finest - grid.level[c])) > voxels.y / 2)
          change[static_cast<size_t>(c)] =
              grid.num_cells() < 40000 ? CellChange::kSplit : CellChange::kKeep;
      std::vector<VertexSource> sources;
      grid = ChangeCells(grid, voxels, change, &sources);
    }
    const GridFrame frame{voxels, {0.1f, -0.2f, 0.05f}, {1.0f, 1.0f, 1.0f}};
    const CellsView cells = ViewOf(grid, voxels);
    std::vector<Ray> rays = RandomRays(200, 7);
    rays.push_back({{-3, -0.2f, 0.05f}, {1, 0, 0}});  // along an edge of level 0
    rays.push_back({{0.1f, -3, 0.3f}, {0, 1, 0}});    // in a face
    rays.push_back(
        {{-0.9f, -1.2f, -0.95f}, Normalized(Vec3f{1, 1, 1})});  // through the corners
    int widths = 0;
    for (const Ray& ray : rays) {
      const RayT<double> exact = ToDouble(ray);
      const double length = LengthInBox(frame, exact, 0.01);
      EXPECT_NEAR(WalkedLength<double>(frame, cells, exact, 0.01), length,
                  testing::RecordDigits("length of a ray in cells", testing::Computed::kDouble,
                                        1e-12, length, length));
      EXPECT_NEAR(WalkedLength<float>(frame, cells, ray, 0.01f, &widths), length,
                  4e-6 * (1 + length));
    }
    if (finest == 4) {
      EXPECT_EQ(widths, 31);  // the rays cross cells of every level
    }
  }
}

TEST(CellWalk, RaysThatMissOrAreInvalidHaveNoSamples) {
  const RadianceField field = RandomCellField({2, 2, 2}, 2, 1, 3);
  const CellsView cells = ViewOf(field.geometry->cells, VoxelsOf(field));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Ray& ray :
       {Ray{{5, 5, 5}, {1, 0, 0}}, Ray{{0, 0, 0}, {0, 0, 0}}, Ray{{nan, 0, 0}, {1, 0, 0}},
        Ray{{0, 0, 0}, {0, nan, 0}}, Ray{{-5, 0, 0}, {-1, 0, 0}}})
    WalkCells(field.geometry->frame, cells, ray, 0.0f, [](const CellSample<float>&) {
      ADD_FAILURE();
      return true;
    });
}

// Constant density and colour over mixed levels render as on one level, to rounding.
TEST(CellRender, H163_AConstantFieldIsTheSameOnMixedLevels) {
  const auto constant = [](CellGrid cells, const Vec3i& voxels) {
    RadianceField field = CellField(std::move(cells), voxels, 4, 1);
    auto geometry = std::make_shared<Geometry>(*field.geometry);
    std::fill(geometry->density.begin(), geometry->density.end(), 1.3f);
    field.geometry = geometry;
    for (int64_t i = 0; i < field.appearance.sh.size(); ++i)
      field.appearance.sh[i] = 0.1f * static_cast<float>(i % 12) - 0.5f;
    return field;
  };
  const RadianceField one = constant(TopCells({2, 2, 2}, 3), {16, 16, 16});
  const RadianceField mixed = constant(RandomCells({2, 2, 2}, 3, 0, 9), {16, 16, 16});
  ASSERT_GT(mixed.geometry->cells.num_cells(), 100);
  const DoubleField a(one), b(mixed);
  for (const Ray& ray : RandomRays(100, 4)) {
    const auto left = RenderRay(a.view(), ToDouble(ray), {0.5f, 0});
    const auto right = RenderRay(b.view(), ToDouble(ray), {0.5f, 0});
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(left.color[c], right.color[c], 1e-12);
    EXPECT_NEAR(left.transmittance, right.transmittance, 1e-12);
    const float rounded = RenderRay(ViewOf(mixed), ray, {0.5f, 0}).color.y;
    EXPECT_NEAR(rounded, right.color.y, 2e-6);
  }
}

// A cell wholly inside of a constant medium: delta is the interval's length, and the sample is
// at its middle.
TEST(CellRender, OneCellIsOneInterval) {
  RadianceField field = CellField(TopCells({1, 1, 1}, 0), {2, 2, 2}, 1, 1);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  geometry->frame = {{1, 1, 1}, {0, 0, 0}, {1, 1, 1}};
  std::fill(geometry->density.begin(), geometry->density.end(), 0.7f);
  field.geometry = geometry;
  const auto result =
      RenderRay(DoubleField(field).view(), RayT<double>{{-5, 0, 0}, {1, 0, 0}}, {0.5f, 0});
  EXPECT_NEAR(result.transmittance, std::exp(-2.0 * double{0.7f}), 1e-12);
  EXPECT_NEAR(result.depth, 5 * (1 - result.transmittance), 1e-11);
}

TEST(ChangeCells, SplittingLeavesTheFieldAndRemovingEmptiesIt) {
  const RadianceField field = CellField(TopCells({3, 4, 3}, 2), {12, 16, 12}, 1, 11);
  const CellGrid& old = field.geometry->cells;
  const Vec3i voxels = VoxelsOf(field);
  std::vector<VertexSource> sources;
  std::vector<CellChange> change(static_cast<size_t>(old.num_cells()), CellChange::kSplit);
  for (size_t c = 0; c < change.size(); c += 3) change[c] = CellChange::kKeep;
  const CellGrid split = ChangeCells(old, voxels, change, &sources);
  std::vector<float> density(static_cast<size_t>(split.num_vertices()));
  MoveValues(old, split, sources, field.geometry->density.data(), 1, density.data());
  const CellsView before = ViewOf(old, voxels), after = ViewOf(split, voxels);
  int checked = 0;
  for (uint64_t i = 0; i < 2000; ++i) {
    Vec3i at;
    Vec3d inside;
    for (int a = 0; a < 3; ++a) {
      const double p = testing::Uniform(31, 3 * i + static_cast<uint64_t>(a), 0, voxels[a]);
      at[a] = static_cast<int>(p);
      inside[a] = p;
    }
    const auto value = [&](const CellGrid& grid, const CellsView& cells, auto* values) {
      CellSample<double> s{};
      s.cell = CellAt(cells, at, &s.width);
      if (s.cell == kNoCell) return -100.0;
      const Vec3i low = PlaceOf(grid.key[s.cell]);
      for (int a = 0; a < 3; ++a) s.fraction[a] = (inside[a] - low[a]) / s.width;
      const std::vector<double> exact(values, values + grid.num_vertices());
      double out;
      InterpolateInCell(cells, s, exact.data(), 1, 1, &out);
      return out;
    };
    if (i % 50 != 0) continue;  // copies of the values are slow
    const double was = value(old, before, field.geometry->density.data());
    EXPECT_NEAR(was, value(split, after, density.data()), 4e-6);
    checked += was > -100;
  }
  EXPECT_GT(checked, 20);
  // Vertices that were there keep their bits.
  for (int64_t v = 0; v < split.num_vertices(); ++v) {
    const int64_t was = FindKey(old.vertex_key, split.vertex_key[v]);
    if (was >= 0) {
      EXPECT_EQ(density[static_cast<size_t>(v)], field.geometry->density[was]);
    }
  }
  change.assign(change.size(), CellChange::kRemove);
  EXPECT_FALSE(ChangeCells(old, voxels, change, &sources).on());
}

TEST(CellField, H165_DamagedCellsAreRefused) {
  const RadianceField good = RandomCellField({2, 2, 2}, 2, 1, 3);
  Validate(good, "field");
  const auto refused = [&](auto damage) {
    RadianceField field = good;
    auto geometry = std::make_shared<Geometry>(*good.geometry);
    damage(geometry.get());
    field.geometry = geometry;
    EXPECT_THROW(Validate(field, "field"), Error);
  };
  refused([](Geometry* g) { g->cells.corner[5] = static_cast<int32_t>(g->num_voxels()); });
  refused([](Geometry* g) { g->cells.corner[5] = -1; });
  refused([](Geometry* g) { g->cells.level[3] = 7; });
  refused([](Geometry* g) { g->cells.key[1] = g->cells.key[0]; });
  refused([](Geometry* g) { g->frame.resolution.x = 6; });
  refused([](Geometry* g) { g->cells.finest = 40; });
  refused([](Geometry* g) { g->density[0] = std::numeric_limits<float>::infinity(); });
}

}  // namespace
}  // namespace regrade
