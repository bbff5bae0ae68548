// Parts of space whose splats are fitted one part at a time, each by a process of its own.
//
// Space is halved again and again by planes along the axes, each half with its share of the
// places that photos see: blocks are boxes, those outside without an end, and every place
// belongs to one of them. An axis is chosen by how far the places spread along it, where what
// is outside of the scene's box counts as contracted, by coordinate as in Barron et al. 2022
// (mip-NeRF 360), eq. 10: far surroundings make few blocks.
//
// Two blocks that were fitted beside each other without seeing each other do not fit where they
// meet (3 dB within 8 pixels of a face in a room of 56 photos). So neighbours are never fitted
// at the same time: blocks have the colours of a map, and one of a later colour sees its
// neighbours of earlier ones as they became. Around its own places it fits a rim of theirs,
// too: of a neighbour that comes later, what it makes there is given up; of one before it, it
// is kept, for it fits both sides of the face at once, and what is behind the rim as it is.
// Blocks that meet in an edge or a corner alone may be fitted at the same time.
//
// A block of an early turn has seen its later neighbours as they were before. So it is fitted
// again at the end, with its neighbours as they became, for the last part of its steps. This
// last turn is an entry of its own for the same box.
#pragma once

#include <vector>

#include "kernels/field/grid_frame.h"
#include "kernels/splats/splat_update.h"

namespace regrade {

struct SpaceBlock {
  SplatHold owned;         // of every place one block's
  SplatHold held;          // with the rim
  std::vector<int> after;  // neighbours that are fitted before it
  int turn = 0;            // its colour: those of earlier turns are fitted first
  double share = 0;        // of all places, those that are held
  int repeats = -1;        // in a last turn the block that is fitted again; else below 0
};
inline constexpr float kLastTurnBegin = 0.75f;  // part of the steps that it leaves out
inline constexpr float kBlockRim = 0.1f;        // of the width of the narrower block at a face

// Does the block keep what it makes at this place (world), until a later one takes it over?
bool Keeps(const std::vector<SpaceBlock>& blocks, size_t block, const float* place);
// The block whose splats are kept at a place in the end.
int OwnerOf(const std::vector<SpaceBlock>& blocks, const float* place);

// `places`: points in the field's frame, one for each of about equally many pixels. Each block
// has the same number of them, up to rounding. Last turns follow behind the `blocks` blocks.
// Throws Error(kUsage) where there are fewer than kLeastPlaces for a block.
std::vector<SpaceBlock> DivideSpace(std::vector<Vec3f> places, const GridFrame& box,
                                    int blocks);
inline constexpr int64_t kLeastPlaces = 200;

}  // namespace regrade
