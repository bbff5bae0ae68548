// What consistency.h measures, as plain data: each pair, and the rows of the table.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/bootstrap.h"
#include "evaluate/warped_error.h"

namespace regrade {

struct PairMotion;  // see evaluate/pair_motion.h

// One pair of one sequence.
struct PairResult {
  std::string sequence;
  int from = 0, to = 0;  // frame indices

  // e, see EQ(tc-psnr); empty if no pixel can be compared.
  std::optional<double> error;
  // -10 log10(e) in dB; +inf for identical frames; empty if `error` is.
  std::optional<double> psnr_db;

  // The same over all pixels that the flow leads to a place inside the frame, without the mask.
  std::optional<double> unmasked_psnr_db;

  double coverage = 0;        // fraction of the frame that was compared, in [0, 1]
  bool low_coverage = false;  // below ConsistencyOptions::min_coverage
  // Numbers of pixels, see OcclusionMask.
  int64_t flow_not_finite = 0, out_of_frame = 0, disoccluded = 0, motion_boundary = 0;
  int64_t colour_not_finite = 0;  // excluded: a colour of this sequence is NaN or inf
  bool above_8bit_floor = false;  // the error per channel is below that of 8-bit frames

  // For JSON, as of FidelityRow.
  template <typename Visit>
  void Describe(Visit& visit) {
    const char* why = error ? "" : "no pixel can be compared";
    int gap = to - from;  // written for readers of the file
    visit("sequence", sequence);
    visit("gap", gap);
    visit("from", from);
    visit("to", to);
    visit.OrNull("error", error, why);
    visit.OrNull("tc_psnr_db", psnr_db, why);
    visit("coverage", coverage);
    visit("low_coverage", low_coverage);
    visit("flow_not_finite", flow_not_finite);
    visit("out_of_frame", out_of_frame);
    visit("disoccluded", disoccluded);
    visit("motion_boundary", motion_boundary);
    visit("colour_not_finite", colour_not_finite);
  }
};

// What a sequence has more than another one, over the pairs of frames that both have.
struct PairedDifference {
  int pairs = 0;
  std::optional<double> mean;
  // 95 % confidence interval of that mean, see EQ(block-bootstrap), with runs as long as the
  // gap: narrower than those of the two means, for both find the same pairs difficult.
  std::optional<Interval> interval;
};

// The summary of all pairs of one sequence at one gap: one row of the table.
struct ConsistencyRow {
  std::string sequence;
  int gap = 0;
  int pairs = 0;            // all, including undefined ones
  int undefined_pairs = 0;  // without comparable pixels: excluded from all means
  int perfect_pairs = 0;    // identical frames (infinite dB): excluded from the mean of dB
  int low_coverage_pairs = 0;
  int pairs_above_8bit_floor = 0;

  // Mean over pairs of psnr_db, without perfect pairs; the headline metric.
  std::optional<double> tc_psnr_mean_db;
  // 95 % confidence interval of that mean over the same pairs, see EQ(block-bootstrap), with
  // runs as long as the gap. Empty for fewer than two runs.
  std::optional<Interval> tc_psnr_interval_db;
  // -10 log10 of the mean error over all defined pairs, including perfect ones (+inf if all are
  // perfect). At most the mean of dB if no pair is perfect (Jensen).
  std::optional<double> tc_psnr_of_mean_db;
  // Mean over pairs of unmasked_psnr_db, infinite ones left out: what the mask changes.
  std::optional<double> tc_psnr_unmasked_mean_db;
  double coverage = 0;  // mean over pairs, in [0, 1]
  std::string why;      // why a metric is missing or infinite; else empty
  // This row's dB less those of ConsistencyReport::compared_with; see AddDifferences.
  std::optional<PairedDifference> difference;
};

// The pair with the largest error of a row, with its motion, which sequences share: from frame
// `at`, where both are compared, to frame `warped`.
struct WorstPair {
  PairResult pair;
  std::shared_ptr<const PairMotion> motion;
  int at = 0, warped = 0;
};

// One pair of one sequence in mode stylegaussian, by both readings of warped_error.h.
struct WarpedPair {
  std::string sequence;
  int from = 0, to = 0;  // frame indices
  WarpedError published, corrected;
};

// The means over the pairs of one sequence at one gap, pairs without a value left out.
struct WarpedRow {
  std::string sequence;
  int gap = 0;
  int pairs = 0;
  WarpedError published, corrected;
  std::string why;                             // why a reading is missing; else empty
  std::optional<PairedDifference> difference;  // of the corrected RMSE, as of ConsistencyRow
};

struct ConsistencyReport {
  std::string mode, flow, warp = "later", error_per = "channel";
  int frames = 0, width = 0, height = 0;  // 0 where no pair was compared
  std::string compared_with;              // the sequence of the rows' differences; or empty
  std::vector<ConsistencyRow> rows;       // by sequence, then by gap, in the order given
  std::vector<PairResult> pairs;          // by first frame, gap, sequence
  // In the order of rows; rows whose pairs are all perfect or undefined have none.
  std::vector<WorstPair> worst;
  // Instead of the others in mode stylegaussian, in the same orders.
  std::vector<WarpedRow> warped;
  std::vector<WarpedPair> warped_pairs;
};

}  // namespace regrade
