#include "pipeline/fields/fit_checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <string>

#include "tests/support/small_field.h"

namespace regrade {
namespace {

FitState StateOf(const RadianceField& field) {
  FitState state;
  state.grid = MakeFastGrid(field);
  state.second_moment.Resize(state.grid.records.size());
  state.sphere_moment.Resize(state.grid.spheres.texels.size());
  for (int64_t i = 0; i < state.sphere_moment.size(); ++i)
    state.sphere_moment[i] = 0.25f * static_cast<float>(i);
  state.stage = 1;
  state.step = 17;
  state.tally = {1.5, 2.5, 3, 4, 5, 6, 7, {{8, 9.5, 10.5, 11}, {12, 13.5, 14.5, 15}}};
  return state;
}

TEST(FitCheckpoint, AGridComesBackBitForBit) {
  FitState state = StateOf(testing::RandomField({5, 4, 6}, 4, 0.5, 1));
  for (int64_t i = 0; i < state.second_moment.size(); ++i)
    state.second_moment[i] = 0.5f + static_cast<float>(i);
  const std::string bytes = PackFitState(state, "a note").Joined();
  std::string note;
  const std::optional<FitState> back = UnpackFitState(bytes, &note);
  ASSERT_TRUE(back);
  EXPECT_EQ(note, "a note");
  const auto same = [](const auto& a, const auto& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  };
  EXPECT_TRUE(same(back->grid.links, state.grid.links));
  EXPECT_TRUE(same(back->grid.records, state.grid.records));
  EXPECT_TRUE(same(back->second_moment, state.second_moment));
  EXPECT_TRUE(same(back->grid.brick_distance, state.grid.brick_distance));
  EXPECT_FALSE(UnpackFitState(bytes + '\0'));
  std::string of_cells = bytes;
  of_cells[0] = 3;
  EXPECT_FALSE(UnpackFitState(of_cells));
  const auto unpacks = [&state](const std::function<void(FastGrid*)>& damage) {
    FitState damaged = state;
    damage(&damaged.grid);
    return UnpackFitState(PackFitState(damaged).Joined()).has_value();
  };
  EXPECT_TRUE(unpacks([](FastGrid*) {}));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->frame.resolution.y = 1 << 24; }));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->links[0] = 1 << 20; }));
  EXPECT_FALSE(unpacks([](FastGrid* grid) { grid->records.Resize(grid->records.size() - 1); }));
}

TEST(FitCheckpoint, BackgroundSpheresComeBackBitForBit) {
  RadianceField field = testing::RandomField({5, 4, 6}, 4, 0.5, 1);
  const std::string without = PackFitState(StateOf(field)).Joined();
  testing::AddSpheres(6, 5, 0.6, 2, &field);
  const FitState state = StateOf(field);
  const std::string with = PackFitState(state).Joined();
  // The last section exists only with spheres.
  EXPECT_EQ(with.substr(0, without.size()), without);
  EXPECT_GT(with.size(), without.size());
  ASSERT_TRUE(UnpackFitState(without));
  EXPECT_FALSE(UnpackFitState(without)->grid.spheres.on());

  const std::optional<FitState> back = UnpackFitState(with);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->step, 17);
  EXPECT_EQ(back->tally.tail_error, 2.5);
  EXPECT_EQ(back->tally.rejected_voxels, 7);
  ASSERT_EQ(back->tally.curve.size(), 2u);
  EXPECT_EQ(back->tally.curve[1].psnr_train_db, 14.5);
  EXPECT_EQ(back->tally.curve[1].step, 15);
  const FastSpheres &a = back->grid.spheres, &b = state.grid.spheres;
  EXPECT_EQ(a.layers, b.layers);
  EXPECT_EQ(a.resolution, b.resolution);
  EXPECT_TRUE(std::equal(a.links.begin(), a.links.end(), b.links.begin(), b.links.end()));
  EXPECT_TRUE(std::equal(a.texels.begin(), a.texels.end(), b.texels.begin(), b.texels.end()));
  EXPECT_TRUE(std::equal(back->sphere_moment.begin(), back->sphere_moment.end(),
                         state.sphere_moment.begin(), state.sphere_moment.end()));
  // The arrays are packed where they are.
  const auto at = reinterpret_cast<const char*>(state.grid.records.data());
  int in_place = 0;
  const BytePacker packed = PackFitState(state);
  for (const std::string_view piece : packed.Pieces()) in_place += piece.data() == at;
  EXPECT_EQ(in_place, 1);
  // Truncated bytes are refused.
  for (const size_t size : {without.size() + 1, without.size() + 8, with.size() - 1})
    EXPECT_FALSE(UnpackFitState(std::string_view(with).substr(0, size))) << size;
}

}  // namespace
}  // namespace regrade
