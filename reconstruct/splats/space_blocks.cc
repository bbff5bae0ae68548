#include "reconstruct/splats/space_blocks.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "kernels/base/error.h"

namespace regrade {
namespace {

using Places = std::span<Vec3f>;

// The coordinate below which `part` of the places are; changes their order.
float Quantile(Places places, int axis, double part) {
  const auto at = places.begin() +
                  static_cast<std::ptrdiff_t>(part * static_cast<double>(places.size() - 1));
  std::ranges::nth_element(places, at, {}, [axis](const Vec3f& p) { return p[axis]; });
  return (*at)[axis];
}

class Division {
 public:
  explicit Division(const GridFrame& box) : box_(box) {}

  void Divide(Places places, const SplatHold& owned, int blocks) {
    if (blocks == 1) {
      blocks_.push_back({.owned = owned, .held = owned, .after = {}});
      widths_.push_back(WidthOf(places));
      return;
    }
    const int left = blocks / 2, axis = WidestAxis(places);
    const size_t count =
        places.size() * static_cast<size_t>(left) / static_cast<size_t>(blocks);
    std::ranges::nth_element(places, places.begin() + static_cast<std::ptrdiff_t>(count), {},
                             [axis](const Vec3f& p) { return p[axis]; });
    const float face = places[count][axis];
    SplatHold low = owned, high = owned;
    low.high[axis] = high.low[axis] = face;
    Divide(places.first(count), low, left);
    Divide(places.subspan(count), high, blocks - left);
  }

  // With turns and rims.
  std::vector<SpaceBlock> Finish() {
    for (size_t i = 0; i < blocks_.size(); ++i) {
      std::vector<bool> taken(i + 1);
      for (size_t j = 0; j < i; ++j)
        if (FaceOf(blocks_[i].owned, blocks_[j].owned))
          taken[static_cast<size_t>(blocks_[j].turn)] = true;
      blocks_[i].turn = static_cast<int>(std::ranges::find(taken, false) - taken.begin());
    }
    const size_t count = blocks_.size();
    std::vector<std::vector<int>> beside(count);
    for (size_t i = 0; i < count; ++i) beside[i] = AddRims(i);
    AddLastTurns(beside);
    return std::move(blocks_);
  }

 private:
  float Contracted(float coordinate, int axis) const {
    const float x = (coordinate - box_.center[axis]) / box_.radius[axis];
    return std::abs(x) <= 1 ? x : std::copysign(2 - 1 / std::abs(x), x);
  }

  // By world lengths within the box: a unit of a long side is more.
  int WidestAxis(Places places) const {
    int widest = 0;
    float most = -1;
    for (int axis = 0; axis < 3; ++axis) {
      const float low = Quantile(places, axis, kFew), high = Quantile(places, axis, 1 - kFew);
      const float spread = (Contracted(high, axis) - Contracted(low, axis)) * box_.radius[axis];
      if (spread > most) most = spread, widest = axis;
    }
    return widest;
  }

  static Vec3f WidthOf(Places places) {
    Vec3f width;
    for (int axis = 0; axis < 3; ++axis)
      width[axis] = Quantile(places, axis, 1 - kFew) - Quantile(places, axis, kFew);
    return width;
  }

  // A face that two boxes share: the axis that it is across, and whether it is the upper end of
  // the first; empty where they share none.
  struct Face {
    int axis;
    bool upper;
  };
  static std::optional<Face> FaceOf(const SplatHold& block, const SplatHold& other) {
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = block.high[axis] == other.low[axis];
      if (!upper && block.low[axis] != other.high[axis]) continue;
      const int b = (axis + 1) % 3, c = (axis + 2) % 3;
      const auto overlap = [&](int a) {
        return block.low[a] < other.high[a] && other.low[a] < block.high[a];
      };
      if (overlap(b) && overlap(c)) return Face{axis, upper};
    }
    return std::nullopt;
  }

  // A rim is no wider than the narrowest block at the face wants it: outer ones have far
  // places. Returns the neighbours.
  std::vector<int> AddRims(size_t i) {
    std::vector<int> beside;
    Vec3f low = widths_[i], high = widths_[i];
    for (size_t j = 0; j < blocks_.size(); ++j) {
      const std::optional<Face> face = FaceOf(blocks_[i].owned, blocks_[j].owned);
      if (!face) continue;
      float& width = (face->upper ? high : low)[face->axis];
      width = std::min(width, widths_[j][face->axis]);
      beside.push_back(static_cast<int>(j));
      if (blocks_[j].turn < blocks_[i].turn) blocks_[i].after.push_back(static_cast<int>(j));
    }
    blocks_[i].held.low = blocks_[i].owned.low - low * kBlockRim;  // without an end it stays so
    blocks_[i].held.high = blocks_[i].owned.high + high * kBlockRim;
    return beside;
  }

  // For the blocks that a neighbour waited for, in the order of their turns.
  void AddLastTurns(const std::vector<std::vector<int>>& beside) {
    const int turns = 1 + std::ranges::max(blocks_, {}, &SpaceBlock::turn).turn;
    std::vector<int> last(beside.size(), -1);
    for (int turn = 0; turn < turns - 1; ++turn)
      for (size_t i = 0; i < beside.size(); ++i) {
        const auto waits = [&](int j) { return blocks_[static_cast<size_t>(j)].turn > turn; };
        if (blocks_[i].turn != turn || std::ranges::none_of(beside[i], waits)) continue;
        SpaceBlock more = blocks_[i];
        more.after = beside[i];
        more.after.push_back(static_cast<int>(i));
        for (const int j : beside[i])
          if (last[static_cast<size_t>(j)] >= 0)
            more.after.push_back(last[static_cast<size_t>(j)]);
        more.turn = turns + turn;
        more.repeats = static_cast<int>(i);
        last[i] = static_cast<int>(blocks_.size());
        blocks_.push_back(std::move(more));
      }
  }

  static constexpr double kFew = 0.05;  // of places, that a spread leaves out on either side

  const GridFrame& box_;
  std::vector<SpaceBlock> blocks_;
  std::vector<Vec3f> widths_;  // [blocks]: of what is in it
};

}  // namespace

bool Keeps(const std::vector<SpaceBlock>& blocks, size_t block, const float* place) {
  const SpaceBlock& own = blocks[block];
  return own.owned.Contains(place) ||
         (own.held.Contains(place) && std::ranges::any_of(own.after, [&](int before) {
            return blocks[static_cast<size_t>(before)].owned.Contains(place);
          }));
}

int OwnerOf(const std::vector<SpaceBlock>& blocks, const float* place) {
  int owner = -1;
  for (size_t i = 0; i < blocks.size(); ++i)
    if (Keeps(blocks, i, place) &&
        (owner < 0 || blocks[i].turn >= blocks[static_cast<size_t>(owner)].turn))
      owner = static_cast<int>(i);
  return owner;
}

std::vector<SpaceBlock> DivideSpace(std::vector<Vec3f> places, const GridFrame& box,
                                    int blocks) {
  REGRADE_CHECK(blocks >= 1);
  const int64_t count = std::ssize(places);
  if (count < kLeastPlaces * blocks)
    throw UsageError(Concat("the photos show too little for ", blocks, " blocks"), "--blocks",
                     Concat("give at most ", std::max<int64_t>(1, count / kLeastPlaces)));
  Division division(box);
  division.Divide(places, {}, blocks);
  std::vector<SpaceBlock> divided = division.Finish();
  for (SpaceBlock& block : divided) {
    const auto held = std::ranges::count_if(
        places, [&block](const Vec3f& p) { return block.held.Contains(&p.x); });
    block.share = static_cast<double>(held) / static_cast<double>(count);
  }
  return divided;
}

}  // namespace regrade
