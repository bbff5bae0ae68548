// Temporal consistency: how well each frame agrees with a later one, moved along the true
// motion.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/bootstrap.h"
#include "evaluate/frame_source.h"
#include "evaluate/pair_motion.h"
#include "kernels/base/options.h"
#include "kernels/base/progress.h"

namespace regrade {

struct ConsistencyOptions {
  std::vector<int> gaps{1, 5};
  std::string mode = "lai2018";
  std::string flow = "dis-medium";
  std::string lpips;
  double min_coverage = 0.4;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("gaps", gaps,
         {.unit = "frames",
          .help = "distances of the compared frames; 1 is the paper's short range, 5 its long",
          .min = 1,
          .max = 100000});
    bind("mode", mode,
         {.help = "which pixels are compared: estimated flow with the mask of Lai 2018 or of "
                  "Ruder 2016, or exact flow from depth and cameras",
          .choices = "lai2018|ruder2016|geometry"});
    bind("flow", flow,
         {.help = "optical flow of the reference frames: dis-ultrafast, dis-fast, dis-medium, "
                  "dis-tuned, farneback (costs 1 : 1.3 : 5 : 25 : 16 in time, errors in "
                  "COSTS.md), with OpenCV's optflow deepflow, tvl1, pca-flow, rlof; "
                  "files:DIR with 00000_00001.flo both ways; onnx:FILE, a network with inputs "
                  "named first and second, RGB from -1 to 1"});
    bind("lpips", lpips,
         {.help = "ONNX file of a network that says how different two pictures look, with "
                  "inputs as --flow onnx:FILE has them; measured between a sequence and the "
                  "2D method's frames"});
    bind("min-coverage", min_coverage,
         {.unit = "share of pixels",
          .help =
              "pairs with fewer comparable pixels are flagged; unrelated pictures reach 0.35, "
              "neighbouring views of a scene 0.8",
          .min = 0,
          .max = 1});
  }
};

// One pair of one sequence.
struct PairResult {
  std::string sequence;
  int from = 0, to = 0;  // frame indices

  // EQ(tc-psnr): e = sum_x M(x) |O_to(x + f(x)) - O_from(x)|^2 / (C sum_x M(x)), the squared
  // error averaged over trusted pixels AND the C = 3 colour channels (Lai et al. 2018); f and M
  // are flow and mask of the reference frames; bilinear, border repeated, values as given (not
  // clipped). Summing channels instead would lower every figure by 4.77 dB. Empty where no
  // pixel can be compared.
  std::optional<double> error;
  // -10 log10(e), white = 1; +inf for identical frames; empty as `error` is.
  std::optional<double> psnr_db;

  double coverage = 0;        // share of the frame that was compared, in [0, 1]
  bool low_coverage = false;  // below ConsistencyOptions::min_coverage
  // Pixels, see OcclusionMask.
  int64_t flow_not_finite = 0, out_of_frame = 0, disoccluded = 0, motion_boundary = 0;
  int64_t colour_not_finite = 0;  // left out because a colour of this sequence is NaN or inf
};

// All pairs of one sequence at one gap: one line of the table.
struct ConsistencyRow {
  std::string sequence;
  int gap = 0;
  int pairs = 0;            // looked at, undefined ones included
  int undefined_pairs = 0;  // nothing to compare: in no mean
  int perfect_pairs = 0;    // identical, infinite dB: not in the mean of dB
  int low_coverage_pairs = 0;
  int pairs_above_8bit_floor = 0;  // above 58.9 dB, finer than frames of 8 bits can tell

  // Mean over pairs of the pairs' dB, without perfect ones; the headline figure.
  std::optional<double> tc_psnr_mean_db;
  // In which 95 % of such means would lie, see EQ(block-bootstrap), runs as long as the gap;
  // over the pairs that are in the mean. Empty below two runs.
  std::optional<Interval> tc_psnr_interval_db;
  // dB of the mean error over all defined pairs, perfect ones included (+inf if all are). Never
  // above the mean of dB when no pair is perfect (Jensen).
  std::optional<double> tc_psnr_of_mean_db;
  double coverage = 0;  // mean over pairs
  std::string why;      // why a figure is missing or infinite; else empty
};

struct ConsistencyReport {
  std::string mode, flow, mask_formula;
  std::vector<ConsistencyRow> rows;  // by sequence, then by gap, in the order given
  std::vector<PairResult> pairs;     // by first frame, gap, sequence
};

// Compares frame i with frame i + gap of each sequence, for every i and gap. Flow and mask come
// from the reference frames (the unstyled ones, never a styled sequence), once for each pair,
// so that all sequences are judged on the same pixels; mode "geometry" takes them from
// `geometry`. Few frames are held at a time.
//
// Errors: kUsage for unknown modes or a gap below 1; kInput when counts, sizes or channels of
// the frames differ, or when frames are too small for flow. Progress counts pairs.
ConsistencyReport EvaluateConsistency(const FrameSource& reference,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress = {},
                                      const GeometrySource& geometry = {});

// The same with motion from anywhere; options.mode and options.flow are only carried along.
ConsistencyReport EvaluateConsistency(int frames, const PairMotionFunction& motion,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress = {});

// The report of frames that cannot be compared: every pair is counted as undefined, and `why`
// is each row's reason.
ConsistencyReport UndefinedConsistency(int frames,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyOptions& options,
                                       const std::string& why);

// One pair on its own. `later` and `earlier` are frames of one sequence, sized as the flow.
// Fills error, psnr_db, coverage and the counts.
PairResult ComparePair(const Image& earlier, const Image& later, const PairMotion& motion);

// One row from the pairs of one sequence and gap.
ConsistencyRow Summarize(const std::string& sequence, int gap,
                         const std::vector<PairResult>& pairs);

}  // namespace regrade
