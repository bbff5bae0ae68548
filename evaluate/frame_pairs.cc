#include "evaluate/frame_pairs.h"

#include <algorithm>
#include <iterator>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"

namespace regrade {

std::vector<std::pair<int, int>> FramePairs(int frames, const std::vector<int>& gaps,
                                            int excerpt) {
  for (const int gap : gaps)
    if (gap < 1) throw UsageError("gaps between frames start at 1", std::to_string(gap));
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < frames; ++i)
    for (const int gap : gaps)
      if (gap < frames - i && (excerpt == 0 || i / excerpt == (i + gap) / excerpt))
        pairs.emplace_back(i, i + gap);
  return pairs;
}

int64_t FramesBetween(const std::vector<int>& gaps, int frames) {
  const int longest = gaps.empty() ? 1 : *std::ranges::max_element(gaps);
  return std::clamp(longest, 1, std::max(1, frames)) + TasksAtOnce(0);
}

FrameCache CacheOf(const FrameSource& sequence, const std::vector<int>& gaps, int64_t bytes) {
  return {sequence.frame, FramesBetween(gaps, sequence.count), bytes};
}

std::vector<FrameCache> CachesOf(const std::vector<NamedFrameSource>& sequences, int frames,
                                 const std::vector<int>& gaps) {
  std::vector<FrameCache> caches;
  for (const NamedFrameSource& sequence : sequences) {
    if (sequence.frames.count != frames)
      throw InputError(
          Concat("the sequence has ", sequence.frames.count, " frames, the reference ", frames),
          sequence.name, "evaluate frames of the same cameras");
    caches.push_back(CacheOf(sequence.frames, gaps, kFrameCacheBytes / std::ssize(sequences)));
  }
  return caches;
}

int ColourChannels(const Image& image) { return std::min(image.channels, 3); }

void CheckFrame(const Image& frame, const FlowField& flow, const Image& first,
                const std::string& sequence, int index) {
  const std::string where = Concat(sequence, ", frame ", index);
  if (frame.width != flow.width || frame.height != flow.height)
    throw InputError(
        Concat("a frame of ", frame.width, " x ", frame.height,
               " px does not fit the reference of ", flow.width, " x ", flow.height, " px"),
        where, "render all sequences at one size");
  if (ColourChannels(frame) != ColourChannels(first))
    throw InputError("grey and colour frames in one sequence", where);
}

}  // namespace regrade
