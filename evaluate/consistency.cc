#include "evaluate/consistency.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>

#include "evaluate/frame_cache.h"
#include "evaluate/frame_pairs.h"
#include "evaluate/optional_mean.h"
#include "evaluate/warped_rows.h"
#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/image/row_sum.h"
#include "kernels/image/warp.h"

namespace regrade {
namespace {

// Rounding to 8 bits has a mean square error of (1/255)^2 / 12: 58.9 dB.
const double kByteFloorDb = -10 * std::log10(1.0 / 12 / (255.0 * 255.0));

struct PairSums {
  double squared_error = 0, weight = 0;
  double unmasked_error = 0;
  int64_t unmasked = 0, colour_not_finite = 0;
  PairSums& operator+=(const PairSums& o) {
    squared_error += o.squared_error;
    weight += o.weight;
    unmasked_error += o.unmasked_error;
    unmasked += o.unmasked;
    colour_not_finite += o.colour_not_finite;
    return *this;
  }
};

double Decibel(double error) {
  return error > 0 ? -10 * std::log10(error) : std::numeric_limits<double>::infinity();
}

// A pair of frames of every sequence, whose motion they share.
struct PairTask {
  int i = 0, j = 0;
  bool warps_earlier = false;
  std::vector<std::pair<std::shared_ptr<const Image>, std::shared_ptr<const Image>>> frames =
      {};  // i and j of each sequence
  std::shared_ptr<const PairMotion> motion = nullptr;
  std::vector<PairResult> results = {};

  int at() const { return warps_earlier ? j : i; }
  int warped() const { return warps_earlier ? i : j; }

  void Run(const PairMotionFunction& motion_of, const std::vector<NamedFrameSource>& sequences,
           const ConsistencyOptions& options) {
    motion = std::make_shared<const PairMotion>(motion_of(at(), warped()));
    for (size_t s = 0; s < sequences.size(); ++s) {
      const std::string& name = sequences[s].name;
      const auto& [earlier, later] = frames[s];
      CheckFrame(*earlier, motion->flow, *earlier, name, i);
      CheckFrame(*later, motion->flow, *earlier, name, j);
      PairResult result =
          ComparePair(warps_earlier ? *later : *earlier, warps_earlier ? *earlier : *later,
                      *motion, options.error_per == "pixel");
      result.sequence = name;
      result.from = i;
      result.to = j;
      result.low_coverage = result.coverage < options.min_coverage;
      results.push_back(std::move(result));
    }
    frames.clear();
  }
};

}  // namespace

PairResult ComparePair(const Image& at, const Image& warped, const PairMotion& motion,
                       bool per_pixel) {
  const FlowField& flow = motion.flow;
  REGRADE_CHECK_EQ(at.width, flow.width);
  REGRADE_CHECK_EQ(at.height, flow.height);
  REGRADE_CHECK(at.SameSize(warped) && at.SameSize(motion.mask.weight));
  const int channels = ColourChannels(at);
  REGRADE_CHECK_EQ(channels, ColourChannels(warped));

  const PairSums sums = SumOverRows(flow.height, [&](int y) {
    PairSums row;
    for (int x = 0; x < flow.width; ++x) {
      const double weight = *motion.mask.weight.at(x, y);
      const float* f = flow.at(x, y);
      const BilinearTaps taps = TapsAt(x + static_cast<double>(f[0]),
                                       y + static_cast<double>(f[1]), flow.width, flow.height);
      if (!(weight > 0) && !taps.in_frame) continue;
      double squared = 0;
      for (int c = 0; c < channels; ++c) {
        const double difference = Sample(taps, warped, c) - at.at(x, y)[c];
        squared += difference * difference;
      }
      if (!std::isfinite(squared)) {
        row.colour_not_finite += weight > 0;
        continue;
      }
      if (taps.in_frame) {
        row.unmasked_error += squared;
        ++row.unmasked;
      }
      if (!(weight > 0)) continue;
      row.squared_error += weight * weight * squared;  // the mask is within the norm
      row.weight += weight;
    }
    return row;
  });

  PairResult result;
  if (sums.weight > 0) {
    const double per_channel = sums.squared_error / (channels * sums.weight);
    result.error = per_pixel ? channels * per_channel : per_channel;
    result.psnr_db = Decibel(*result.error);
    result.above_8bit_floor = Decibel(per_channel) > kByteFloorDb;
  }
  if (sums.unmasked > 0) {
    const double divisor = (per_pixel ? 1.0 : channels) * static_cast<double>(sums.unmasked);
    result.unmasked_psnr_db = Decibel(sums.unmasked_error / divisor);
  }
  result.coverage = sums.weight / static_cast<double>(at.num_pixels());
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
  OptionalMean unmasked;
  for (const PairResult& pair : pairs) {
    if (pair.sequence != sequence || pair.to - pair.from != gap) continue;
    ++row.pairs;
    sum_coverage += pair.coverage;
    row.low_coverage_pairs += pair.low_coverage;
    if (pair.unmasked_psnr_db && std::isfinite(*pair.unmasked_psnr_db))
      unmasked.Add(pair.unmasked_psnr_db);
    if (!pair.error) {
      ++row.undefined_pairs;
      continue;
    }
    ++defined;
    sum_error += *pair.error;
    row.pairs_above_8bit_floor += pair.above_8bit_floor;
    if (std::isinf(*pair.psnr_db)) {
      ++row.perfect_pairs;
      continue;
    }
    finite_db.push_back(*pair.psnr_db);
  }
  if (row.pairs > 0) row.coverage = sum_coverage / row.pairs;
  row.tc_psnr_unmasked_mean_db = unmasked.Value();
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
  const auto pairs = FramePairs(frames, options.gaps, options.excerpt);
  std::vector<FrameCache> caches = CachesOf(sequences, frames, options.gaps);
  ConsistencyReport report;
  report.mode = options.mode;
  report.flow = options.mode == "geometry" ? "depth and cameras" : options.flow;
  report.warp = options.warp;
  report.error_per = options.error_per;
  report.frames = frames;
  std::map<std::pair<size_t, int>, WorstPair> worst;  // by sequence and gap
  // Pairs in parallel; frames come from one thread, and results are taken in order.
  const int64_t count = std::ssize(pairs);
  int64_t bytes_of_pair = 0;
  for (FrameCache& cache : caches)
    if (count > 0) bytes_of_pair += 2 * CachedBytes(*cache.Get(pairs.front().first));
  const int64_t at_once = TasksAtOnce(bytes_of_pair);
  for (int64_t begin = 0; begin < count; begin += at_once) {
    std::vector<PairTask> tasks;
    for (int64_t p = begin; p < std::min(count, begin + at_once); ++p) {
      const auto [i, j] = pairs[static_cast<size_t>(p)];
      PairTask task{i, j, options.warp == "earlier"};
      for (FrameCache& cache : caches) task.frames.emplace_back(cache.Get(i), cache.Get(j));
      tasks.push_back(std::move(task));
    }
    const auto run = [&](int64_t t) {
      tasks[static_cast<size_t>(t)].Run(motion, sequences, options);
    };
    if (options.mode == "geometry")  // whose depth is rendered in parallel
      for (int64_t t = 0; t < std::ssize(tasks); ++t) run(t);
    else
      ParallelTasks(0, std::ssize(tasks), run);
    report.width = tasks.front().motion->flow.width;
    report.height = tasks.front().motion->flow.height;
    for (PairTask& task : tasks)
      for (size_t s = 0; s < sequences.size(); ++s) {
        PairResult& result = task.results[s];
        WorstPair& so_far = worst[{s, task.j - task.i}];
        if (result.error && *result.error > so_far.pair.error.value_or(0))
          so_far = {result, task.motion, task.at(), task.warped()};
        report.pairs.push_back(std::move(result));
      }
    ReportOrThrow(progress, begin + std::ssize(tasks), count);
  }
  for (size_t s = 0; s < sequences.size(); ++s)
    for (const int gap : options.gaps)
      if (const auto found = worst.find({s, gap});
          found != worst.end() && found->second.motion != nullptr)
        report.worst.push_back(found->second);
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
  report.warp = options.warp;
  report.error_per = options.error_per;
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : options.gaps) {
      ConsistencyRow row;
      row.sequence = sequence.name;
      row.gap = gap;
      row.pairs = row.undefined_pairs =
          static_cast<int>(FramePairs(frames, {gap}, options.excerpt).size());
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
    return EvaluateConsistency(
        reference.count,
        GeometricMotion(geometry, FramesBetween(options.gaps, reference.count)), sequences,
        options, progress);
  }
  if (options.mode == kWarpedMode) {
    const ConsistencyOptions plain;
    if (options.warp != plain.warp || options.error_per != plain.error_per)
      throw UsageError("mode stylegaussian moves frames forward and has an error of its own",
                       options.warp != plain.warp ? "--warp" : "--error-per",
                       "leave it out, or choose another mode");
    return EvaluateWarped(reference, sequences, options, progress);
  }
  return EvaluateConsistency(
      reference.count,
      EstimatedMotion(reference, options.mode, options.flow,
                      FramesBetween(options.gaps, reference.count), options.flow_frames),
      sequences, options, progress);
}

}  // namespace regrade
