// Styles of adaptive fields: positions of all levels in one frame, losses and votes by cells.
#include <algorithm>
#include <set>

#include "kernels/field/refine_cells.h"
#include "kernels/field/render_ray.h"
#include "kernels/splats/splat_field.h"
#include "stylize/field/blend_fields.h"
#include "stylize/field/object_weights.h"
#include "stylize/field/volume_variance.h"
#include "tests/support/algorithm1.h"
#include "tests/support/cell_field.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// Cells of level 2, 2 voxels wide, where x < 8, and of level 1, 4 voxels wide, beyond.
constexpr Vec3i kVoxels{16, 16, 16};
constexpr int kFace = 8;

RadianceField TwoLevels() {
  CellGrid grid = TopCells({2, 2, 2}, 3);
  for (int level = 0; level < 2; ++level) {
    std::vector<CellChange> change;
    for (int64_t c = 0; c < grid.num_cells(); ++c)
      change.push_back(level == 0 || PlaceOf(grid.key[c]).x < kFace ? CellChange::kSplit
                                                                    : CellChange::kKeep);
    std::vector<VertexSource> sources;
    grid = ChangeCells(grid, kVoxels, change, &sources);
  }
  return CellField(std::move(grid), kVoxels, 9, 3);
}

// Of a voxel of `frame`'s box: its place in [-1, 1] across the box.
Vec3d PlaceInBox(const GridFrame& frame, const Vec3f& grid) {
  const Vec3f world = frame.WorldOf(grid);
  Vec3d place;
  for (int a = 0; a < 3; ++a)
    place[a] = (double{world[a]} - frame.center[a]) / double{frame.radius[a]};
  return place;
}

// The position input is where a vertex lies in the box, of a uniform grid's frame as of a
// lattice's, whose place k is k - 1/2 of that frame.
TEST(CellStyle, PositionsOfAllLevelsAreInOneFrame) {
  const RadianceField field = RandomCellField({2, 3, 2}, 3, 4, 7);
  const Geometry& geometry = *field.geometry;
  const std::vector<int32_t> vertex = VertexOfVoxel(geometry);
  for (int64_t v = 0; v < geometry.num_voxels(); ++v) {
    float row[kFeatureStride];
    FillFeatures(field, 0.5f, v, vertex[static_cast<size_t>(v)], row);
    const Vec3f at = PlaceOf(geometry.cells.vertex_key[v]).Cast<float>();
    const Vec3d expected = PlaceInBox(geometry.frame, at - Vec3f{0.5f, 0.5f, 0.5f});
    for (int a = 0; a < 3; ++a)  // float's rounding of world positions
      EXPECT_NEAR(row[kNetworkSh + a], 0.5 * expected[a], 1e-6) << v;
    EXPECT_EQ(row[9], field.appearance.sh[v * 12 + 4]);
  }
  const RadianceField uniform = RandomField({5, 4, 6}, 4, 1.0, 1);
  float row[kFeatureStride];
  FillFeatures(uniform, 0.5f, 0, uniform.geometry->frame.Vertex(3, 1, 4), row);
  const Vec3d expected = PlaceInBox(uniform.geometry->frame, {3, 1, 4});
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(row[kNetworkSh + a], 0.5 * expected[a], 1e-6);
}

// Coefficients [27] that are linear in the place in the box: cells of any size blend them
// exactly.
void LinearRecord(const Vec3d& place, double* sh) {
  for (size_t i = 0; i < kNetworkSh; ++i)
    sh[i] = 0.5 * Random(70, i) + 0.6 * Random(71, i) * place.x +
            0.6 * Random(72, i) * place.y + 0.6 * Random(73, i) * place.z;
}

// The largest difference, over random points of cells of level `level`, of the restyled field's
// blend to the network applied to the exact record. `at_face`: points in the face, as this side
// sees it; otherwise points of the cells that do not touch it.
double ErrorOfCells(const RadianceField& field, const Appearance& styled,
                    const LipschitzNetwork& network, int level, bool at_face) {
  const GridFrame& frame = field.geometry->frame;
  const CellGrid& grid = field.geometry->cells;
  const CellsView cells = ViewOf(grid, kVoxels);
  double largest = 0;
  for (int64_t c = 0; c < grid.num_cells(); ++c) {
    const Vec3i low = PlaceOf(grid.key[c]);
    const int width = 1 << (grid.finest - grid.level[c]);
    const bool touches = low.x + width == kFace || low.x == kFace;
    if (grid.level[c] != level || touches != at_face) continue;
    for (uint64_t i = 0; i < 12; ++i) {
      const uint64_t n = 36 * static_cast<uint64_t>(c) + 3 * i;
      CellSample<float> sample{};
      sample.cell = static_cast<int32_t>(c);
      for (int a = 0; a < 3; ++a)
        sample.fraction[a] = static_cast<float>(Uniform(8, n + static_cast<uint64_t>(a), 0, 1));
      if (at_face) sample.fraction.x = low.x == kFace ? 0 : 1;
      float blend[kNetworkSh];
      InterpolateInCell(cells, sample, styled.sh.data(), kNetworkSh, kNetworkSh, blend);
      Vec3f grid_place;
      for (int a = 0; a < 3; ++a)
        grid_place[a] =
            static_cast<float>(low[a]) + sample.fraction[a] * static_cast<float>(width) - 0.5f;
      const Vec3d place = PlaceInBox(frame, grid_place);
      double features[kNetworkInputs], exact[kNetworkSh] = {}, sum = 0;
      LinearRecord(place, features);
      for (int a = 0; a < 3; ++a) features[kNetworkSh + a] = place[a];
      network.ForwardPlain(features, exact);
      for (int k = 0; k < kNetworkSh; ++k) sum += (blend[k] - exact[k]) * (blend[k] - exact[k]);
      largest = std::max(largest, std::sqrt(sum));
    }
  }
  return largest;
}

// A finer cell's corner inside of a coarser cell's face is a record of its own, restyled at its
// own place: a strong network bends at the face no more than inside of the cells.
TEST(CellStyle, AFaceBetweenLevelsIsNoWorseThanTheCellsBesideIt) {
  RadianceField field = TwoLevels();
  const Geometry& geometry = *field.geometry;
  for (int64_t v = 0; v < geometry.num_voxels(); ++v) {
    double sh[kNetworkSh];
    const Vec3f at = PlaceOf(geometry.cells.vertex_key[v]).Cast<float>();
    LinearRecord(PlaceInBox(geometry.frame, at - Vec3f{0.5f, 0.5f, 0.5f}), sh);
    for (int k = 0; k < kNetworkSh; ++k)
      field.appearance.sh[v * kNetworkSh + k] = static_cast<float>(sh[k]);
  }
  const LipschitzNetwork network = RandomNetwork(95, 3);
  const Appearance styled = ApplyNetwork(network, field);
  for (const int level : {1, 2}) {
    const double inside = ErrorOfCells(field, styled, network, level, false),
                 at_face = ErrorOfCells(field, styled, network, level, true);
    // The network is strong: what it makes of a line is no line.
    EXPECT_GT(inside, level == 1 ? 0.2 : 0.05);
    EXPECT_LE(at_face, inside * RecordBound("error at a face over that inside of cells",
                                            Computed::kFloat, at_face / inside, 1.5))
        << "level " << level;
  }
}

RadianceField OpaqueCells(int basis, float contrast) {
  RadianceField field = RandomCellField({3, 3, 3}, 2, basis, 11);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  for (float& density : geometry->density) density = 40 * std::abs(density);
  field.geometry = geometry;
  for (float& value : field.appearance.sh) value *= contrast;
  return field;
}

TEST(CellStyle, GradientEqualsAlgorithm1) {
  const RadianceField field = RandomCellField({2, 3, 2}, 2, 9, 11);
  const StyleRays batch = SomeRays(3, 8);
  LipschitzNetwork network = RandomNetwork(91);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const size_t size = static_cast<size_t>(LipschitzNetwork().NumParameters());
  std::vector<double> gradient(size), expected(size);
  const AggregationResult result =
      GradientAggregation(field, {.view_weight = 0.7}).Run(network, batch, &gradient);
  EXPECT_GT(result.touched_voxels, 100);
  const RayWeights weights = ComputeRayWeights(
      *field.geometry, {batch.rays.data(), static_cast<int64_t>(batch.rays.size())}, {}, 0);
  std::vector<Vec3d> directions, targets;
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    directions.push_back(batch.rays[r].direction.Cast<double>());
    targets.push_back(batch.targets[r].Cast<double>());
  }
  DenseNetwork<double> d_effective;
  for (int l = 0; l < kNetworkLayers; ++l)
    d_effective.layers.emplace_back(network.Outputs(l), network.Inputs(l));
  const double loss =
      Algorithm1<double>(network, field, weights, directions, targets,
                         1 / (3.0 * static_cast<double>(batch.rays.size())), 0.7, &d_effective);
  network.AddGradient(d_effective, &expected);
  EXPECT_NEAR(result.loss, loss, 1e-5 * loss);  // float, as of a uniform grid
  EXPECT_LE(RelativeDifference(gradient, expected), 1e-5);
}

// The paper's sum divides by what fills space, however it is divided into cells.
TEST(CellStyle, LossesCountCellsByTheirVolume) {
  const RadianceField field = RandomCellField({2, 3, 2}, 2, 1, 11);
  const CellGrid& cells = field.geometry->cells;
  const CellsView view = ViewOf(cells, field.geometry->frame.resolution);
  const Vec3i n = field.geometry->frame.resolution;
  int64_t covered = 0;
  for (int x = 0; x < n.x; ++x)
    for (int y = 0; y < n.y; ++y)
      for (int z = 0; z < n.z; ++z) {
        int width;
        covered += CellAt(view, {x, y, z}, &width) != kNoCell;
      }
  EXPECT_EQ(SpatialCount(*field.geometry), static_cast<double>(covered));
  EXPECT_EQ(SpatialCount(*Ball(6).geometry),
            static_cast<double>(Ball(6).geometry->num_voxels()));
  const StyleRays batch = SomeRays(1, 8);
  const LipschitzNetwork network = RandomNetwork(92);
  const double mean = GradientAggregation(field, {}).Run(network, batch, nullptr).loss,
               sum = GradientAggregation(field, {.divide_by_voxels = true})
                         .Run(network, batch, nullptr)
                         .loss;
  EXPECT_NEAR(sum / mean,
              3.0 * static_cast<double>(batch.rays.size()) / static_cast<double>(covered),
              1e-12);
}

// A picture made by a colour map gives that map back.
TEST(CellStyle, LeastSquaresFindTheMapOfAnAdaptiveField) {
  RadianceField field = OpaqueCells(4, 0.3f);
  RadianceField mapped = field;
  mapped.appearance = ApplyColorMap(field.appearance, SomeMap());
  mapped.background = field.background = {0, 0, 0};
  StyleRays batch = SomeRays(4, 24);
  for (size_t r = 0; r < batch.rays.size(); ++r)
    batch.targets[r] = RenderRay(ViewOf(mapped), batch.rays[r], {}).color;
  const ColorMap found = LeastSquaresMap(field, batch, {});
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)  // float renders, of which a small spread of colours is fitted
      EXPECT_NEAR(found.matrix(i, j), SomeMap().matrix(i, j), 2e-3);
    EXPECT_NEAR(found.offset[i], SomeMap().offset[i], 2e-3);
  }
}

TEST(CellStyle, BoundsOfPairsHoldOnAdaptiveFields) {
  const RadianceField source = OpaqueCells(9, 0.15f);
  LipschitzNetwork network = RandomNetwork(301, 0.9);
  network.data().has_base = true;
  network.data().base = SomeMap();
  network.data().base.offset = {0.1, 0.05, 0.1};
  RadianceField styled = source;
  styled.appearance = ApplyNetwork(network, source);
  const VarianceReport report =
      MeasureVariance(source, styled, network, NeighbouringPixels(Ring(6, 60), 2000, 3), {});
  EXPECT_GT(report.valid.pairs, 200);
  EXPECT_GT(report.largest_fraction, 0.1);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);  // float's rounding of restyled coefficients
}

// Masks vote for the corners of the cells that a ray passes, and for no texel behind them.
TEST(CellStyle, MasksVoteForCellsCorners) {
  RadianceField field = RandomCellField({2, 2, 2}, 2, 1, 5);
  AddSpheres(3, 4, 1.0, 4, &field);
  const Camera camera = Ring(1, 16)[0];
  MaskVote vote(*field.geometry, 0, {});
  Image mask(16, 16, 1);
  std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
  vote.Add(camera, mask);
  std::set<int32_t> seen;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) {
      const Ray ray = camera.PixelRay(x, y);
      for (const WeightedSample& sample :
           ComputeRayWeights(*field.geometry, {&ray, 1}, {}, 0).samples)
        for (int k = 0; k < 8 && !sample.on_sphere(); ++k)
          if (sample.weight * CornerWeight(sample.fraction, k) > 1e-9f)
            seen.insert(field.geometry->cells.corner[8 * int64_t{sample.vertex} + k]);
    }
  ASSERT_GT(seen.size(), 50u);
  const std::vector<float> weights = vote.Weights(0.5, 0.1);
  int64_t voted = 0;
  for (size_t v = 0; v < weights.size(); ++v) {
    voted += weights[v] > 0;
    if (seen.count(static_cast<int32_t>(v)) > 0) {
      EXPECT_EQ(weights[v], 1) << v;
    }
  }
  EXPECT_EQ(voted, static_cast<int64_t>(seen.size()));
}

TEST(CellStyle, H49_StylesOfOtherCellsAreRefused) {
  const RadianceField source = RandomCellField({2, 2, 2}, 1, 1, 5);
  RadianceField same = source;
  same.geometry = std::make_shared<Geometry>(*source.geometry);
  EXPECT_TRUE(SameGeometry(*source.geometry, *same.geometry));
  const auto changed = [&](auto change) {
    auto geometry = std::make_shared<Geometry>(*source.geometry);
    change(&geometry->cells);
    RadianceField other = source;
    other.geometry = geometry;
    EXPECT_THROW(MixFields(source, {&other}, {0.5}, nullptr), Error);
  };
  changed([](CellGrid* cells) { cells->level[0] ^= 1; });
  changed([](CellGrid* cells) { cells->key[cells->key.size() - 1] ^= 1; });
  changed([](CellGrid* cells) { cells->finest = 2; });
  EXPECT_EQ(MixFields(source, {&same}, {1}, nullptr).appearance.sh[5], source.appearance.sh[5]);
}

// Positions of splats: as voxels' within the box, EQ(splat-position) outside of it.
TEST(FillFeatures, SplatsFarOutsideStayInReach) {
  Splats splats(3, 1);
  const Vec3f means[] = {{2, 1, -3}, {5, 1, -1}, {1e20f, 0, 1}};
  for (int i = 0; i < 3; ++i) splats.Set(i, {.mean = means[i]});
  const RadianceField field = FieldOfSplats(splats, {{}, {1, 1, -1}, {2, 1, 4}}, 0, -1);
  const Vec3f expected[] = {{0.5f, 0, -0.5f}, {1.5f, 0, 0}, {2, 0, 0}};
  for (int i = 0; i < 3; ++i) {
    float row[kFeatureStride];
    FillFeatures(field, 3, i, i, row);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(row[27 + a], 3 * expected[i][a], 1e-5) << i;
  }
}

}  // namespace
}  // namespace regrade
