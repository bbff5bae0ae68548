// Files of adaptive fields: field.npz, styled.npz remade, a fit's checkpoint, and the uniform
// grid that is exported.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <vector>

#include "kernels/base/half.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/pad_sh_basis.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/fields/uniform_field.h"
#include "pipeline/files/npz_file.h"
#include "pipeline/stages/styled_field.h"
#include "stylize/training/style_engine.h"
#include "stylize/training/training_targets.h"
#include "tests/support/cell_field.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::RandomCellField;
using testing::ReadText;
using testing::TemporaryFolder;

template <typename T>
bool Same(const Buffer<T>& a, const Buffer<T>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
}

void ExpectSameCells(const CellGrid& a, const CellGrid& b) {
  EXPECT_EQ(a.finest, b.finest);
  EXPECT_TRUE(Same(a.key, b.key));
  EXPECT_TRUE(Same(a.level, b.level));
  EXPECT_TRUE(Same(a.corner, b.corner));
  EXPECT_TRUE(Same(a.vertex_key, b.vertex_key));
  EXPECT_TRUE(Same(a.top, b.top));
  EXPECT_TRUE(Same(a.nodes, b.nodes));
}

StoredField Stored(int basis) {
  StoredField stored;
  stored.field = RandomCellField({2, 3, 2}, 3, basis, 5);
  stored.field.near_clip = 0.125f;
  stored.field_from_world.scale = 3;
  return stored;
}

TEST(CellFile, RoundTripIsExactUpToHalfColours) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9}) {
    const StoredField out = Stored(basis);
    WriteFieldFile(folder / "field.npz", out);
    const StoredField in = ReadFieldFile(folder / "field.npz");
    const Geometry &a = *in.field.geometry, &b = *out.field.geometry;
    ExpectSameCells(a.cells, b.cells);
    EXPECT_EQ(a.frame.resolution, b.frame.resolution);
    EXPECT_EQ(a.frame.radius, b.frame.radius);
    EXPECT_EQ(a.links.size(), 0);
    EXPECT_TRUE(Same(a.density, b.density));
    ASSERT_EQ(in.field.appearance.basis, basis);
    for (int64_t i = 0; i < out.field.appearance.sh.size(); ++i)
      ASSERT_EQ(in.field.appearance.sh[i],
                FloatFromHalf(HalfFromFloat(out.field.appearance.sh[i])));
    EXPECT_EQ(in.field.near_clip, 0.125f);
    EXPECT_EQ(in.field_from_world.scale, 3);
    WriteFieldFile(folder / "again.npz", in);
    EXPECT_EQ(ReadText(folder / "again.npz"), ReadText(folder / "field.npz"));
  }
}

// svox2 reads `links`, which such a file has not; readers of version 1 refuse version 2. A
// uniform grid's file has none of this.
TEST(CellFile, OtherReadersRefuseIt) {
  const TemporaryFolder folder;
  const StoredField out = Stored(4);
  WriteFieldFile(folder / "field.npz", out);
  NpzReader file(folder / "field.npz", 1 << 22);
  EXPECT_FALSE(file.Has("links"));
  EXPECT_EQ(file.ReadScalar<int32_t>("regrade_version"), 2);
  const int64_t cells = out.field.geometry->cells.num_cells();
  file.Read("regrade_cells_key", ArrayType::kU64, {cells});
  file.Read("regrade_cells_level", ArrayType::kU8, {cells});
  file.Read("density_data", ArrayType::kF32, {out.field.geometry->num_voxels(), 1});
  file.Read("sh_data", ArrayType::kF16, {out.field.geometry->num_voxels(), 27});
  EXPECT_EQ(file.Read("regrade_cells_size", ArrayType::kI32, {3}).As<int32_t>()[1], 24);
  StoredField uniform;
  uniform.field = testing::RandomField({4, 3, 5}, 4, 0.6, 3);
  WriteFieldFile(folder / "uniform.npz", uniform);
  NpzReader other(folder / "uniform.npz", 1 << 22);
  EXPECT_EQ(other.ReadScalar<int32_t>("regrade_version"), 1);
  for (const std::string& name : other.names()) EXPECT_NE(name.rfind("regrade_cells", 0), 0u);
}

class DamagedCells : public ::testing::Test {
 protected:
  // Writes the file with what `change` makes of its arrays, and reads it.
  struct Arrays {
    std::vector<int32_t> size;
    int32_t finest;
    std::vector<CellKey> key;
    std::vector<uint8_t> level;
    std::vector<float> density, sh;
    bool links = false;
  };
  void ReadWith(const std::function<void(Arrays*)>& change) {
    const RadianceField field = RandomCellField({2, 3, 2}, 2, 9, 5);
    const Geometry& geometry = *field.geometry;
    const Vec3i n = geometry.frame.resolution;
    Arrays arrays{{n.x, n.y, n.z},
                  geometry.cells.finest,
                  {geometry.cells.key.begin(), geometry.cells.key.end()},
                  {geometry.cells.level.begin(), geometry.cells.level.end()},
                  {geometry.density.begin(), geometry.density.end()},
                  {field.appearance.sh.begin(), field.appearance.sh.end()}};
    change(&arrays);
    NpzWriter writer;
    writer.Add("radius", {3}, &geometry.frame.radius.x);
    writer.Add("center", {3}, &geometry.frame.center.x);
    writer.Add("regrade_cells_size", {3}, arrays.size.data());
    writer.AddScalar<int32_t>("regrade_cells_finest", arrays.finest);
    writer.Add("regrade_cells_key", {static_cast<int64_t>(arrays.key.size())},
               arrays.key.data());
    writer.Add("regrade_cells_level", {static_cast<int64_t>(arrays.level.size())},
               arrays.level.data());
    writer.Add("density_data", {static_cast<int64_t>(arrays.density.size()), 1},
               arrays.density.data());
    writer.Add("sh_data", {static_cast<int64_t>(arrays.sh.size()) / 27, 27}, arrays.sh.data());
    const int32_t link = -1;
    if (arrays.links) writer.Add("links", {1, 1, 1}, &link);
    writer.WriteTo(folder_ / "field.npz");
    ReadFieldFile(folder_ / "field.npz");
  }
  void ExpectRefused(const std::string& array, const std::string& why,
                     const std::function<void(Arrays*)>& change) {
    try {
      ReadWith(change);
      ADD_FAILURE() << why << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
      EXPECT_NE(error.what_failed().find(why), std::string::npos) << error.what_failed();
      EXPECT_NE(error.where().find("field.npz"), std::string::npos) << error.where();
      EXPECT_NE(error.where().find(array), std::string::npos) << error.where();
    }
  }

  TemporaryFolder folder_;
};

TEST_F(DamagedCells, F68_CellsOutOfTheirPlaceAreRefused) {
  ReadWith([](Arrays*) {});
  const char* const keys = "regrade_cells_key";
  ExpectRefused(keys, "cell 1 overlaps", [](Arrays* a) { std::swap(a->key[0], a->key[1]); });
  ExpectRefused(keys, "cell 1 overlaps", [](Arrays* a) { a->key[1] = a->key[0]; });
  ExpectRefused(keys, "overlaps another", [](Arrays* a) { a->key.back() = KeyOf({8, 0, 0}); });
  ExpectRefused(keys, "overlaps another", [](Arrays* a) { a->key.back() = ~CellKey{0}; });
  ExpectRefused(keys, "overlaps another", [](Arrays* a) { a->level[0] = 3; });
  ExpectRefused(keys, "overlaps another",
                [](Arrays* a) { *std::max_element(a->level.begin(), a->level.end()) = 0; });
  ExpectRefused(keys, "does not divide", [](Arrays* a) { a->size[1] = 11; });
  ExpectRefused(keys, "does not divide", [](Arrays* a) { a->size[2] = -8; });
  ExpectRefused(keys, "does not divide", [](Arrays* a) { a->size[2] = 1 << 21; });
  ExpectRefused(keys, "finest level", [](Arrays* a) { a->finest = 17; });
  ExpectRefused(keys, "finest level", [](Arrays* a) { a->finest = -1; });
  ExpectRefused(keys, "no cells", [](Arrays* a) { a->key.clear(), a->level.clear(); });
  ExpectRefused("regrade_cells_level", "expected", [](Arrays* a) { a->level.pop_back(); });
}

// A tree of 2^60 entries behind a file of a few bytes.
TEST_F(DamagedCells, F66_HostileSizesAreRefusedBeforeTheirTreeIsMade) {
  ExpectRefused("regrade_cells_key", "cells of level 0", [](Arrays* a) {
    a->finest = 0;
    a->size = {1 << 20, 1 << 20, 1 << 20};
    std::fill(a->level.begin(), a->level.end(), uint8_t{0});
  });
}

TEST_F(DamagedCells, F66_RowsThatDisagreeAreRefused) {
  ExpectRefused("sh_data", "vertices", [](Arrays* a) { a->sh.resize(a->sh.size() - 27); });
  ExpectRefused("density_data", "expected", [](Arrays* a) { a->density.pop_back(); });
  ExpectRefused("links", "not both", [](Arrays* a) { a->links = true; });
  ExpectRefused("", "not finite", [](Arrays* a) { a->density[3] = NAN; });
}

FitState StateOf(const RadianceField& field) {
  FitState state;
  state.grid = MakeFastGrid(field);
  state.grid.density_rate.Resize(state.grid.num_voxels());
  for (int64_t i = 0; i < state.grid.density_rate.size(); ++i)
    state.grid.density_rate[i] = 0.5f + static_cast<float>(i);
  state.second_moment.Resize(state.grid.records.size());
  state.stage = 1;
  state.step = 17;
  return state;
}

TEST(CellCheckpoint, CellsComeBackBitForBit) {
  RadianceField field = RandomCellField({2, 3, 2}, 3, 4, 5);
  for (const bool spheres : {false, true}) {
    if (spheres) testing::AddSpheres(6, 5, 0.6, 2, &field);
    const FitState state = StateOf(field);
    const std::string bytes = PackFitState(state, "a note").Joined();
    std::string note;
    const std::optional<FitState> back = UnpackFitState(bytes, &note);
    ASSERT_TRUE(back);
    EXPECT_EQ(note, "a note");
    EXPECT_EQ(back->step, 17);
    ExpectSameCells(back->grid.cells(), state.grid.cells());
    EXPECT_TRUE(Same(back->grid.records, state.grid.records));
    EXPECT_TRUE(Same(back->grid.density_rate, state.grid.density_rate));
    EXPECT_TRUE(Same(back->grid.vertex_density, state.grid.vertex_density));
    EXPECT_EQ(back->grid.spheres.on(), spheres);
    for (const size_t size : {bytes.size() - 1, bytes.size() / 2, size_t{40}})
      EXPECT_FALSE(UnpackFitState(std::string_view(bytes).substr(0, size))) << size;
  }
}

TEST(CellCheckpoint, DamagedCellsAreRefused) {
  const auto unpacks = [](const std::function<void(FastGrid*)>& damage) {
    FitState state = StateOf(RandomCellField({2, 3, 2}, 2, 4, 5));
    damage(&state.grid);
    return UnpackFitState(PackFitState(state).Joined()).has_value();
  };
  EXPECT_TRUE(unpacks([](FastGrid*) {}));
  EXPECT_TRUE(unpacks([](FastGrid* grid) { grid->density_rate = {}; }));
  const auto unpacks_cells = [&unpacks](const std::function<void(CellGrid*)>& damage) {
    return unpacks([&damage](FastGrid* grid) {
      CellGrid cells = grid->cells();
      damage(&cells);
      grid->SetCells(std::move(cells));
    });
  };
  EXPECT_TRUE(unpacks_cells([](CellGrid*) {}));
  EXPECT_FALSE(unpacks_cells([](CellGrid* cells) { std::swap(cells->key[0], cells->key[1]); }));
  EXPECT_FALSE(unpacks_cells([](CellGrid* cells) { cells->level[0] = 200; }));
  EXPECT_FALSE(unpacks_cells([](CellGrid* cells) { cells->finest = 40; }));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->frame.resolution.y = 1 << 24; }));
  EXPECT_FALSE(
      unpacks([](FastGrid* grid) { grid->records.Resize(grid->records.size() - 16); }));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->density_rate.Resize(1); }));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->links.Resize(8); }));
}

Camera SmallCamera() {
  Camera camera;
  camera.width = 24, camera.height = 18;
  camera.fx = camera.fy = 24, camera.cx = 12, camera.cy = 9;
  camera.camera_from_world.translation = {0, 0, 2.5};
  return camera;
}

// As stage stylize does it, with a few steps.
TEST(CellStyledFile, IsRemadeFromFieldAndNetwork) {
  const TemporaryFolder folder;
  WriteFieldFile(folder / "field.npz", Stored(4));
  StoredField stored = ReadFieldFile(folder / "field.npz");
  const Camera camera = SmallCamera();
  const Image photo = RenderView(stored.field, camera, {stored.field.step}).color;
  Image target = photo;
  for (size_t i = 0; i < target.pixels.size(); ++i)
    target.pixels[i] = 0.1f + (i % 3 == 0 ? 0.8f : 0.5f) * target.pixels[i] * target.pixels[i];
  TrainingTargets targets;
  StyledTrainingView view{camera};
  view.name = "view";
  targets.Add(view, photo, target);
  stored.field.appearance = PadShBasis(std::move(stored.field.appearance), 9);
  const MarchOptions march{stored.field.step};
  TrainNetworkOptions options;
  options.steps = 5;
  const auto engine = MakeStyleEngine(Backend::kCpu, &stored.field, march, options);
  std::vector<std::string> notices;
  const std::vector<StyledTrainingView> views = targets.views();
  const TrainNetworkResult trained =
      TrainNetwork(stored.field, views, targets.SceneMap(&notices), march, options, {}, nullptr,
                   engine.get());
  const Vec3f background{0.25f, 0.5f, 0.125f};
  WriteNetworkFile(folder / "network.npz", {trained.network, trained.k_est, background});
  StoredField styled = stored;
  styled.field.appearance = engine->Restyle(trained.network, nullptr);
  styled.field.background = background;
  WriteFieldFile(folder / "styled.npz", styled);

  WriteFieldFile(folder / "again.npz",
                 StyledFieldOf(ReadFieldFile(folder / "field.npz"),
                               ReadNetworkFile(folder / "network.npz"), 1, nullptr));
  EXPECT_TRUE(ReadText(folder / "again.npz") == ReadText(folder / "styled.npz"));
  EXPECT_FALSE(ReadText(folder / "again.npz") == ReadText(folder / "field.npz"));
}

TEST(UniformField, ResolutionsKeepTheBoxsProportions) {
  const RadianceField cells = RandomCellField({2, 3, 2}, 3, 1, 5);
  EXPECT_EQ(UniformResolution(cells, 0), (Vec3i{16, 24, 16}));
  EXPECT_EQ(UniformResolution(cells, 12), (Vec3i{8, 12, 8}));
  RadianceField fine = cells;
  auto geometry = std::make_shared<Geometry>(*cells.geometry);
  geometry->frame.resolution = {1024, 2048, 1024};
  fine.geometry = geometry;
  EXPECT_EQ(UniformResolution(fine, 0), (Vec3i{256, 512, 256}));
  geometry->cells = {};
  EXPECT_EQ(UniformResolution(fine, 0), (Vec3i{1024, 2048, 1024}));
}

// Values that are linear in the place are the same on cells of all levels and on a grid.
TEST(UniformField, BlendsOfLinearValuesAreExact) {
  RadianceField field = RandomCellField({2, 3, 2}, 3, 4, 5);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  const CellGrid& cells = geometry->cells;
  const auto linear = [](const Vec3f& place, int lane) {  // place in [0, 1] of the box
    return 0.3f * static_cast<float>(lane) + place.x - 2 * place.y + 3 * place.z;
  };
  const Vec3i voxels = geometry->frame.resolution;
  const auto place_of = [](const Vec3f& at, const Vec3i& n) {
    return Vec3f{at.x / static_cast<float>(n.x), at.y / static_cast<float>(n.y),
                 at.z / static_cast<float>(n.z)};
  };
  for (int64_t v = 0; v < cells.num_vertices(); ++v) {
    const Vec3f place = place_of(PlaceOf(cells.vertex_key[v]).Cast<float>(), voxels);
    geometry->density[v] = linear(place, 12);
    for (int i = 0; i < 12; ++i) field.appearance.sh[12 * v + i] = linear(place, i);
  }
  field.geometry = geometry;
  const CellsView view = ViewOf(cells, voxels);
  for (const Vec3i& n : {voxels, Vec3i{7, 30, 11}}) {
    const RadianceField uniform = ToUniform(field, n, 1 << 30);
    Validate(uniform, "uniform");
    EXPECT_EQ(uniform.geometry->frame.radius, geometry->frame.radius);
    int64_t stored = 0, empty = 0;
    for (int x = 0; x < n.x; ++x)
      for (int y = 0; y < n.y; ++y)
        for (int z = 0; z < n.z; ++z) {
          const Vec3f place =
              place_of(Vec3i{x, y, z}.Cast<float>() + Vec3f{0.5f, 0.5f, 0.5f}, n);
          Vec3i at;
          for (int a = 0; a < 3; ++a)
            at[a] = static_cast<int>(place[a] * static_cast<float>(voxels[a]));
          int width;
          const bool is_cell = CellAt(view, at, &width) != kNoCell;
          const int32_t link = uniform.geometry->links[uniform.geometry->frame.Vertex(x, y, z)];
          ASSERT_EQ(link >= 0, is_cell) << x << " " << y << " " << z;
          ++(is_cell ? stored : empty);
          if (!is_cell) continue;
          // Eight products of numbers up to 8, in float.
          EXPECT_NEAR(uniform.geometry->density[link], linear(place, 12), 1e-5);
          EXPECT_NEAR(uniform.appearance.sh[12 * link + 7], linear(place, 7), 1e-5);
        }
    EXPECT_GT(stored, 1000);
    EXPECT_GT(empty, 100);
  }
}

TEST(UniformField, AUniformGridAtItsOwnResolutionIsItself) {
  RadianceField field = testing::RandomField({5, 4, 6}, 9, 0.5, 1);
  testing::AddSpheres(3, 4, 0.6, 2, &field);
  const RadianceField same = ToUniform(field, {5, 4, 6}, 1 << 30);
  EXPECT_TRUE(Same(same.geometry->links, field.geometry->links));
  EXPECT_TRUE(Same(same.geometry->density, field.geometry->density));
  EXPECT_TRUE(Same(same.appearance.sh, field.appearance.sh));
  EXPECT_TRUE(Same(same.appearance.sphere_color, field.appearance.sphere_color));
  EXPECT_EQ(same.background, field.background);
}

TEST(UniformField, TooLargeGridsAreRefused) {
  const RadianceField field = RandomCellField({2, 3, 2}, 3, 9, 5);
  EXPECT_REGRADE_ERROR(ToUniform(field, {800, 1200, 800}, 1000000), ExitCode::kResources,
                       "3072 MB");
  EXPECT_REGRADE_ERROR(ToUniform(field, {32, 48, 32}, 1000000), ExitCode::kResources,
                       "32 x 48 x 32");
}

}  // namespace
}  // namespace regrade
