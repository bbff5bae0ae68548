// A run's frames in groups that are rendered whole, whichever process renders them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
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

// All frames of the sets, in their order, each unit of at most kFilmGroup: films are encoded in
// such groups. Pointers into `sets`.
std::vector<FrameUnit> UnitsOf(const std::vector<FrameSet>& sets);

// Those of the part "K/N": each N-th, beginning with the K-th. Throws as ParsePart.
std::vector<FrameUnit> UnitsOfPart(const std::vector<FrameUnit>& units,
                                   const std::string& part);

// Units that are rendered from one field: all, where `splats` and what renders them fit into
// `memory` bytes (0: not known) or there are voxels (`splats` is 0), else each by itself, from
// the splats in its pictures.
std::vector<std::vector<FrameUnit>> BatchesWithin(const std::vector<FrameUnit>& units,
                                                  int64_t splats, uint64_t memory);

std::vector<Camera> CamerasOf(const std::vector<FrameUnit>& units);

// To be called before each of their frames, with its set: reports how much is done, and throws
// as ReportOrThrow.
std::function<void(const FrameSet&)> TickOf(const std::vector<FrameUnit>& units,
                                            const ProgressFunction& progress);

}  // namespace regrade
