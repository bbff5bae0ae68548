#include "evaluate/consistency.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>

#include "evaluate/frame_cache.h"
#include "kernels/base/error.h"
#include "kernels/image/row_sum.h"
#include "kernels/image/warp.h"

namespace regrade {
namespace {

// Rounding to 8 bits has a mean square error of (1/255)^2 / 12: 58.9 dB.
const double kByteFloorDb = -10 * std::log10(1.0 / 12 / (255.0 * 255.0));

constexpr int64_t kCacheBytes = 512ll << 20;  // for all sequences together

struct PairSums {
  double squared_error = 0, weight = 0;
  int64_t colour_not_finite = 0;
  PairSums& operator+=(const PairSums& o) {
    squared_error += o.squared_error;
    weight += o.weight;
    colour_not_finite += o.colour_not_finite;
    return *this;
  }
};

int ColourChannels(const Image& image) { return std::min(image.channels, 3); }

double Decibel(double error) {
  return error > 0 ? -10 * std::log10(error) : std::numeric_limits<double>::infinity();
}

void CheckFrame(const Image& frame, const PairMotion& motion, const Image& first,
                const std::string& where) {
  if (frame.width != motion.flow.width || frame.height != motion.flow.height)
    throw InputError(Concat("a frame of ", frame.width, " x ", frame.height,
                            " px does not fit the reference of ", motion.flow.width, " x ",
                            motion.flow.height, " px"),
                     where, "render all sequences at one size");
  if (ColourChannels(frame) != ColourChannels(first))
    throw InputError("grey and colour frames in one sequence", where);
}

std::string FrameName(const std::string& sequence, int index) {
  return Concat(sequence, ", frame ", index);
}

bool InOneExcerpt(int from, int gap, int excerpt) {
  return excerpt == 0 || from / excerpt == (from + gap) / excerpt;
}

int NumPairs(int frames, int gap, int excerpt) {
  int pairs = 0;
  for (int i = 0; i + gap < frames; ++i) pairs += InOneExcerpt(i, gap, excerpt);
  return pairs;
}

}  // namespace

PairResult ComparePair(const Image& earlier, const Image& later, const PairMotion& motion) {
  const FlowField& flow = motion.flow;
  REGRADE_CHECK_EQ(earlier.width, flow.width);
  REGRADE_CHECK_EQ(earlier.height, flow.height);
  REGRADE_CHECK(earlier.SameSize(later) && earlier.SameSize(motion.mask.weight));
  const int channels = ColourChannels(earlier);
  REGRADE_CHECK_EQ(channels, ColourChannels(later));

  const PairSums sums = SumOverRows(flow.height, [&](int y) {
    PairSums row;
    for (int x = 0; x < flow.width; ++x) {
      const double weight = *motion.mask.weight.at(x, y);
      if (!(weight > 0)) continue;
      const float* f = flow.at(x, y);
      const BilinearTaps taps = TapsAt(x + static_cast<double>(f[0]),
                                       y + static_cast<double>(f[1]), flow.width, flow.height);
      double squared = 0;
      for (int c = 0; c < channels; ++c) {
        const double difference = Sample(taps, later, c) - earlier.at(x, y)[c];
        squared += difference * difference;
      }
      if (!std::isfinite(squared)) {
        ++row.colour_not_finite;
        continue;
      }
      row.squared_error += weight * squared;
      row.weight += weight;
    }
    return row;
  });

  PairResult result;
  if (sums.weight > 0) {
    result.error = sums.squared_error / (channels * sums.weight);
    result.psnr_db = Decibel(*result.error);
  }
  result.coverage = sums.weight / static_cast<double>(earlier.num_pixels());
  result.flow_not_finite = motion.mask.not_finite;
  result.out_of_frame = motion.mask.out_of_frame;
  result.disoccluded = motion.mask.disoccluded;
  result.motion_boundary = motion.mask.motion_boundary;
  result.colour_not_finite = sums.colour_not_finite;
  return result;
}

ConsistencyRow Summarize(const std::string& sequence, int gap,
                         const std::vector<PairResult>& pairs) {
  ConsistencyRow row;
  row.sequence = sequence;
  row.gap = gap;
  double sum_error = 0, sum_coverage = 0;
  int defined = 0;
  std::vector<double> finite_db;  // in order of time
  for (const PairResult& pair : pairs) {
    if (pair.sequence != sequence || pair.to - pair.from != gap) continue;
    ++row.pairs;
    sum_coverage += pair.coverage;
    row.low_coverage_pairs += pair.low_coverage;
    if (!pair.error) {
      ++row.undefined_pairs;
      continue;
    }
    ++defined;
    sum_error += *pair.error;
    if (*pair.psnr_db > kByteFloorDb) ++row.pairs_above_8bit_floor;
    if (std::isinf(*pair.psnr_db)) {
      ++row.perfect_pairs;
      continue;
    }
    finite_db.push_back(*pair.psnr_db);
  }
  if (row.pairs > 0) row.coverage = sum_coverage / row.pairs;
  if (defined > 0) row.tc_psnr_of_mean_db = Decibel(sum_error / defined);
  if (!finite_db.empty()) {
    row.tc_psnr_mean_db = std::accumulate(finite_db.begin(), finite_db.end(), 0.0) /
                          static_cast<double>(finite_db.size());
    row.tc_psnr_interval_db = BootstrapMean(finite_db, gap);
  }
  if (row.pairs == 0)
    row.why = Concat("no pair of frames is ", gap, " apart");
  else if (defined == 0)
    row.why = "no pair has a comparable pixel";
  else if (finite_db.empty())
    row.why = "all compared pairs are identical: infinite";
  return row;
}

ConsistencyReport EvaluateConsistency(int frames, const PairMotionFunction& motion,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress) {
  int64_t total = 0;
  int max_gap = 1;
  for (const int gap : options.gaps) {
    if (gap < 1) throw UsageError("gaps between frames start at 1", std::to_string(gap));
    max_gap = std::max(max_gap, gap);
    total += NumPairs(frames, gap, options.excerpt);
  }
  std::vector<FrameCache> caches;
  for (const NamedFrameSource& sequence : sequences) {
    if (sequence.frames.count != frames)
      throw InputError(
          Concat("the sequence has ", sequence.frames.count, " frames, the reference ", frames),
          sequence.name, "evaluate frames of the same cameras");
    caches.emplace_back(sequence.frames, std::min(max_gap, frames) + 1,
                        kCacheBytes / std::ssize(sequences));
  }

  ConsistencyReport report;
  report.mode = options.mode;
  report.flow = options.mode == "geometry" ? "depth and cameras" : options.flow;
  std::vector<WorstPair> worst(sequences.size() * options.gaps.size());
  int64_t done = 0;
  for (int i = 0; i < frames; ++i)
    for (size_t g = 0; g < options.gaps.size(); ++g) {
      const int gap = options.gaps[g];
      if (gap >= frames - i || !InOneExcerpt(i, gap, options.excerpt)) continue;
      const auto pair_motion = std::make_shared<const PairMotion>(motion(i, i + gap));
      for (size_t s = 0; s < sequences.size(); ++s) {
        const std::string& name = sequences[s].name;
        const auto earlier = caches[s].Get(i), later = caches[s].Get(i + gap);
        CheckFrame(*earlier, *pair_motion, *earlier, FrameName(name, i));
        CheckFrame(*later, *pair_motion, *earlier, FrameName(name, i + gap));
        PairResult result = ComparePair(*earlier, *later, *pair_motion);
        result.sequence = name;
        result.from = i;
        result.to = i + gap;
        result.low_coverage = result.coverage < options.min_coverage;
        WorstPair& so_far = worst[s * options.gaps.size() + g];
        if (result.error && *result.error > so_far.pair.error.value_or(0))
          so_far = {result, pair_motion};
        report.pairs.push_back(std::move(result));
      }
      ReportOrThrow(progress, ++done, total);
    }
  std::copy_if(worst.begin(), worst.end(), std::back_inserter(report.worst),
               [](const WorstPair& pair) { return pair.motion != nullptr; });
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : options.gaps)
      report.rows.push_back(Summarize(sequence.name, gap, report.pairs));
  return report;
}

ConsistencyReport UndefinedConsistency(int frames,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyOptions& options,
                                       const std::string& why) {
  ConsistencyReport report;
  report.mode = options.mode;
  report.flow = options.flow;
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : options.gaps) {
      ConsistencyRow row;
      row.sequence = sequence.name;
      row.gap = gap;
      row.pairs = row.undefined_pairs = NumPairs(frames, gap, options.excerpt);
      row.why = why;
      report.rows.push_back(std::move(row));
    }
  return report;
}

ConsistencyReport EvaluateConsistency(const FrameSource& reference,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress,
                                      const GeometrySource& geometry) {
  if (options.mode == "geometry") {
    if (!geometry)
      throw UsageError("mode geometry needs depth and cameras of the frames", "",
                       "evaluate a run's folder, or choose lai2018 or ruder2016");
    return EvaluateConsistency(reference.count, GeometricMotion(geometry), sequences, options,
                               progress);
  }
  // Both frames of a pair are used again by later pairs.
  const int max_gap = options.gaps.empty() ? 1 : *std::ranges::max_element(options.gaps);
  const auto cache = std::make_shared<FrameCache>(
      reference, std::clamp(max_gap, 1, std::max(1, reference.count)) + 1, kCacheBytes);
  const FrameSource cached{reference.count, [cache](int i) { return *cache->Get(i); }};
  return EvaluateConsistency(reference.count,
                             EstimatedMotion(cached, options.mode, options.flow), sequences,
                             options, progress);
}

}  // namespace regrade
