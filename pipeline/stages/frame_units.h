// A run's frames in groups that are rendered whole, whichever process renders them.
#pragma once

#include <string>
#include <vector>

#include "pipeline/stages/film_frames.h"

namespace regrade {

// Frames [begin, end) of a set.
struct FrameUnit {
  const FrameSet* set = nullptr;
  int begin = 0, end = 0;

  // "film_00048": of its folder.
  std::string Name() const;
  // "frames 48 to 95 of the film".
  std::string Text() const;
};

// Of a frame, for the time that is left: its pixels, in millions, of which those that are only
// in the film cost a third (pipeline/run/stage_estimate.cc).
double WorkOf(const FrameSet& set);

// All frames of the sets, in their order, each unit of at most kFilmGroup: films are encoded in
// such groups. Pointers into `sets`.
std::vector<FrameUnit> UnitsOf(const std::vector<FrameSet>& sets);

// Those of the part "K/N": each N-th, beginning with the K-th. Throws as ParsePart.
std::vector<FrameUnit> UnitsOfPart(const std::vector<FrameUnit>& units,
                                   const std::string& part);

}  // namespace regrade
