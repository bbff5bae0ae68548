#include "reconstruct/splats/space_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "kernels/base/random.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

float Draw(uint64_t item, uint64_t of, float low, float high) {
  return low + (high - low) * static_cast<float>(RandomDouble(5, item, of));
}

// A long street, with a tenth of the places far away.
std::vector<Vec3f> Street(int count) {
  std::vector<Vec3f> places;
  for (uint64_t i = 0; i < static_cast<uint64_t>(count); ++i) {
    const float wide = i % 10 == 0 ? 60.0f : 1.0f;
    places.push_back({Draw(i, 0, -4, 4) * wide, Draw(i, 1, -1, 1) * wide, Draw(i, 2, 0, 1)});
  }
  return places;
}

const GridFrame kBox{{}, {0, 0, 0}, {4, 1, 1}};

int64_t CountIn(const std::vector<Vec3f>& places, const SplatHold& hold) {
  return std::ranges::count_if(places,
                               [&](const Vec3f& place) { return hold.Contains(&place.x); });
}

// Without last turns.
std::vector<SpaceBlock> FirstOf(std::vector<SpaceBlock> blocks) {
  std::erase_if(blocks, [](const SpaceBlock& block) { return block.repeats >= 0; });
  return blocks;
}

TEST(SpaceBlocks, EachPlaceIsOwnedOnceAndAllOwnAsMany) {
  const std::vector<Vec3f> places = Street(9000);
  for (const int n : {1, 2, 3, 8, 13}) {
    const std::vector<SpaceBlock> blocks = FirstOf(DivideSpace(places, kBox, n));
    ASSERT_EQ(std::ssize(blocks), n);
    for (const SpaceBlock& block : blocks)
      EXPECT_NEAR(CountIn(places, block.owned), 9000.0 / n, 2) << n;
    for (const Vec3f& place : {places[0], Vec3f{1e20f, -1e20f, 3}, Vec3f{0, 0, 0}})
      EXPECT_EQ(
          std::ranges::count_if(
              blocks, [&](const SpaceBlock& block) { return block.owned.Contains(&place.x); }),
          1);
  }
}

TEST(SpaceBlocks, OneBlockIsAllOfSpace) {
  const SpaceBlock all = DivideSpace(Street(500), kBox, 1)[0];
  EXPECT_EQ(all.owned.low.x, -SplatHold::kUnbounded);
  EXPECT_EQ(all.held.high.z, SplatHold::kUnbounded);
  EXPECT_EQ(all.share, 1);
  EXPECT_TRUE(all.after.empty());
}

// Far surroundings are contracted: a street is cut across, not lengthwise.
TEST(SpaceBlocks, AStreetIsCutAcross) {
  for (const SpaceBlock& block : DivideSpace(Street(9000), kBox, 4)) {
    EXPECT_EQ(block.owned.low.y, -SplatHold::kUnbounded);
    EXPECT_EQ(block.owned.high.z, SplatHold::kUnbounded);
  }
}

TEST(SpaceBlocks, NeighborsTakeTurnsAndALaterOneTakesItsRimOver) {
  const std::vector<Vec3f> places = Street(9000);
  const std::vector<SpaceBlock> blocks = FirstOf(DivideSpace(places, kBox, 4));
  // In a row: every other one waits for those beside it.
  std::vector<size_t> row(blocks.size());
  for (size_t i = 0; i < row.size(); ++i) row[i] = i;
  std::ranges::sort(row, {}, [&](size_t i) { return blocks[i].owned.low.x; });
  for (size_t k = 0; k + 1 < row.size(); ++k) {
    const size_t left = row[k], right = row[k + 1];
    ASSERT_NE(blocks[left].turn, blocks[right].turn);
    EXPECT_LT(std::max(blocks[left].turn, blocks[right].turn), 2);
    const bool left_waits = blocks[left].turn > blocks[right].turn;
    const size_t first = left_waits ? right : left, second = left_waits ? left : right;
    EXPECT_TRUE(blocks[first].after.empty());
    EXPECT_NE(std::ranges::find(blocks[second].after, first), blocks[second].after.end());
    // On both sides of the face, within the rim of the later one.
    const float face = blocks[left].owned.high.x;
    for (const float step : {-1e-3f, 1e-3f}) {
      const Vec3f place{face + step, 0, 0.5f};
      EXPECT_EQ(OwnerOf(blocks, &place.x), static_cast<int>(second));
      EXPECT_TRUE(Keeps(blocks, second, &place.x));
      EXPECT_EQ(Keeps(blocks, first, &place.x), blocks[first].owned.Contains(&place.x));
    }
    EXPECT_GT(blocks[second].share, 0.25);
  }
  for (const Vec3f& place : places) EXPECT_GE(OwnerOf(blocks, &place.x), 0);
}

TEST(SpaceBlocks, ABlockThatCameFirstHasALastTurn) {
  for (const int n : {2, 4, 13}) {
    const std::vector<Vec3f> places = Street(9000);
    const std::vector<SpaceBlock> blocks = DivideSpace(places, kBox, n);
    int last = 0;
    for (int i = 0; i < n; ++i) last = std::max(last, blocks[static_cast<size_t>(i)].turn);
    std::vector<int> entries(static_cast<size_t>(n));
    for (size_t i = 0; i < blocks.size(); ++i) {
      const SpaceBlock& block = blocks[i];
      for (const int before : block.after)
        EXPECT_LT(blocks[static_cast<size_t>(before)].turn, block.turn);
      if (i < static_cast<size_t>(n)) continue;
      EXPECT_GT(block.turn, last);
      // It goes on from its own splats and its neighbours' of all turns.
      ASSERT_NE(std::ranges::find(block.after, block.repeats), block.after.end());
      EXPECT_EQ(block.owned.low.x, blocks[static_cast<size_t>(block.repeats)].owned.low.x);
      ++entries[static_cast<size_t>(block.repeats)];
      for (const Vec3f& place : places)
        if (block.owned.Contains(&place.x)) {
          const int owner = OwnerOf(blocks, &place.x);
          EXPECT_GE(blocks[static_cast<size_t>(owner)].turn, block.turn);
        }
    }
    for (int i = 0; i < n; ++i) {
      const bool is_waited_for =
          std::any_of(blocks.begin(), blocks.begin() + n, [&](const SpaceBlock& other) {
            return std::ranges::find(other.after, i) != other.after.end();
          });
      EXPECT_EQ(entries[static_cast<size_t>(i)], is_waited_for ? 1 : 0) << n << ' ' << i;
    }
  }
}

TEST(SpaceBlocks, TooFewPlacesAreRefused) {
  EXPECT_REGRADE_ERROR(DivideSpace(Street(500), kBox, 3), ExitCode::kUsage, "--blocks");
}

}  // namespace
}  // namespace regrade
