// The pairs of frames that an evaluation compares, and its frames in memory.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "evaluate/flow_field.h"
#include "evaluate/frame_cache.h"
#include "evaluate/frame_source.h"

namespace regrade {

// Every pair (i, i + gap), by i and then by gap in the order given; with excerpt > 0 both lie
// in one run of that many frames. Throws Error(kUsage) for a gap below 1.
std::vector<std::pair<int, int>> FramePairs(int frames, const std::vector<int>& gaps,
                                            int excerpt);

// A cache for each sequence that keeps the frames between a pair's two. Throws Error(kInput)
// where a sequence has another number of frames.
std::vector<FrameCache> CachesOf(const std::vector<NamedFrameSource>& sequences, int frames,
                                 const std::vector<int>& gaps);
FrameCache CacheOf(const FrameSource& sequence, const std::vector<int>& gaps, int64_t bytes);

// How many frames are kept so that each is made once for pairs in order: those between a pair's
// two, and those of the pairs that run at once.
int64_t FramesBetween(const std::vector<int>& gaps, int frames);

// Colour channels of a frame: 1 or 3; alpha is ignored.
int ColourChannels(const Image& image);

// Throws Error(kInput) where frame `index` of a sequence has another size than the flow, or is
// grey where `first` is not.
void CheckFrame(const Image& frame, const FlowField& flow, const Image& first,
                const std::string& sequence, int index);

}  // namespace regrade
