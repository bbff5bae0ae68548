#include "evaluate/warped_rows.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "evaluate/frame_cache.h"
#include "evaluate/frame_pairs.h"
#include "evaluate/optional_mean.h"
#include "evaluate/pair_network.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

// The flow of a sequence itself between padded frames; nothing where files have none.
class OwnFlow {
 public:
  // `of_reference`: the motion of the reference is this sequence's own.
  OwnFlow(const std::string& sequence, const std::string& flow,
          const std::vector<int64_t>& frames, bool of_reference)
      : flow_(PairFlow(flow, frames)) {
    if (!flow.starts_with(kFlowFiles)) return;
    const std::string folder = flow + "/" + sequence;
    if (std::filesystem::is_directory(folder.substr(sizeof(kFlowFiles) - 1)))
      flow_ = PairFlow(folder, frames);
    else if (!of_reference)
      flow_ = {};
    pads_flow_ = true;
  }

  std::optional<FlowField> operator()(int i, int j, const Image& from, const Image& to) const {
    if (!flow_) return std::nullopt;
    if (pads_flow_) return PadFlow(flow_(i, j, from, to));
    return flow_(i, j, PadFrame(from), PadFrame(to));
  }

 private:
  PairFlowFunction flow_;
  bool pads_flow_ = false;
};

WarpedRow Summarize(const std::string& sequence, int gap,
                    const std::vector<WarpedPair>& pairs) {
  WarpedRow row;
  row.sequence = sequence;
  row.gap = gap;
  OptionalMean published, published_lpips, corrected, corrected_lpips, coverage;
  for (const WarpedPair& pair : pairs) {
    if (pair.sequence != sequence || pair.to - pair.from != gap) continue;
    ++row.pairs;
    published.Add(pair.published.rmse);
    published_lpips.Add(pair.published.lpips);
    corrected.Add(pair.corrected.rmse);
    corrected_lpips.Add(pair.corrected.lpips);
    coverage.Add(pair.corrected.coverage);
  }
  row.published = {published.Value(), published_lpips.Value(), 0};
  row.corrected = {corrected.Value(), corrected_lpips.Value(), coverage.Value().value_or(0)};
  if (row.pairs == 0)
    row.why = Concat("no pair of frames is ", gap, " apart");
  else if (!row.published.rmse)
    row.why = "there are no flow files of these frames";
  else if (!row.corrected.rmse)
    row.why = "no pair has a comparable pixel";
  return row;
}

}  // namespace

ConsistencyReport EvaluateWarped(const FrameSource& reference,
                                 const std::vector<NamedFrameSource>& sequences,
                                 const ConsistencyOptions& options,
                                 const ProgressFunction& progress) {
  ConsistencyReport report;
  report.mode = options.mode;
  report.flow = options.flow;
  report.frames = reference.count;
  const auto pairs = FramePairs(reference.count, options.gaps, options.excerpt);
  FrameCache unstyled = CacheOf(reference, options.gaps, kFrameCacheBytes);
  std::vector<FrameCache> caches = CachesOf(sequences, reference.count, options.gaps);
  const PairFlowFunction flow = PairFlow(options.flow, options.flow_frames);
  const PairDistance lpips = PerceptualDistance(options.lpips),
                     raw_lpips = PerceptualDistance(options.lpips, /*as_given=*/true);
  std::vector<OwnFlow> own;
  const bool has_source = sequences.front().name.ends_with("source");
  for (const NamedFrameSource& sequence : sequences)
    own.emplace_back(sequence.name, options.flow, options.flow_frames,
                     sequence.name.ends_with(has_source ? "source" : "styled"));
  int64_t done = 0;
  for (const auto& [i, j] : pairs) {
    const auto from = unstyled.Get(i), to = unstyled.Get(j);
    const FlowField motion = flow(i, j, *from, *to);
    report.width = motion.width;
    report.height = motion.height;
    for (size_t s = 0; s < sequences.size(); ++s) {
      const std::string& name = sequences[s].name;
      const auto earlier = caches[s].Get(i), later = caches[s].Get(j);
      CheckFrame(*earlier, motion, *earlier, name, i);
      CheckFrame(*later, motion, *earlier, name, j);
      WarpedPair pair{name, i, j, {}, {}};
      if (const auto own_flow = own[s](i, j, *earlier, *later))
        pair.published =
            PublishedWarpedError(PadFrame(*earlier), PadFrame(*later), *own_flow, raw_lpips);
      pair.corrected = CorrectedWarpedError(*earlier, *later, *from, *to, motion, lpips);
      report.warped_pairs.push_back(std::move(pair));
    }
    ReportOrThrow(progress, ++done, std::ssize(pairs));
  }
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : options.gaps)
      report.warped.push_back(Summarize(sequence.name, gap, report.warped_pairs));
  return report;
}

}  // namespace regrade
