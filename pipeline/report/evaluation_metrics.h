// What an evaluation measures: consistency, fidelity, and each pair of frames.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluate/consistency_report.h"
#include "evaluate/fidelity_row.h"
#include "pipeline/workspace/metric.h"

namespace regrade {

// Temporal consistency of a sequence over frames `gap` apart.
struct ConsistencyMetrics {
  std::string
      sequence;  // "source" | "views_2d" | "styled" | "photos", or path_ and one of them
  int gap = 1;
  int pairs = 0;                                   // undefined ones included
  int undefined_pairs = 0;                         // nothing to compare; in no mean
  Metric tc_psnr_mean_db;                          // mean of the pairs' dB
  Metric tc_psnr_of_mean_db;                       // dB of the pairs' mean squared error
  Metric tc_psnr_low_db, tc_psnr_high_db;          // 95 % interval of the mean of dB
  std::optional<double> tc_psnr_unmasked_mean_db;  // over all pixels that stay in the frame
  // Less the pairs of the first of several folders: mean, 95 % interval, number of pairs.
  std::optional<double> tc_psnr_difference_db, tc_psnr_difference_low_db,
      tc_psnr_difference_high_db;
  std::optional<int> difference_pairs;
  Metric coverage;                       // mean fraction of compared pixels
  std::vector<Metric> tc_psnr_pairs_db;  // one for each pair in order of time
  std::string heat_map;  // picture of the worst pair, relative to the folder; may be empty
  std::optional<int> heat_map_from;  // first frame of that pair

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("sequence", sequence);
    visit("gap", gap);
    visit("pairs", pairs);
    visit("undefined_pairs", undefined_pairs);
    visit("tc_psnr_mean_db", tc_psnr_mean_db);
    visit("tc_psnr_of_mean_db", tc_psnr_of_mean_db);
    visit("tc_psnr_low_db", tc_psnr_low_db);
    visit("tc_psnr_high_db", tc_psnr_high_db);
    visit("tc_psnr_unmasked_mean_db", tc_psnr_unmasked_mean_db);
    visit("tc_psnr_difference_db", tc_psnr_difference_db);
    visit("tc_psnr_difference_low_db", tc_psnr_difference_low_db);
    visit("tc_psnr_difference_high_db", tc_psnr_difference_high_db);
    visit("difference_pairs", difference_pairs);
    visit("coverage", coverage);
    visit("tc_psnr_pairs_db", tc_psnr_pairs_db);
    visit("heat_map", heat_map, {.optional = true});
    visit("heat_map_from", heat_map_from);
  }
};

// A sequence over frames `gap` apart by forward warping; see evaluate/warped_error.h.
struct WarpedMetrics {
  std::string sequence;
  int gap = 1;
  int pairs = 0;
  Metric rmse_published, rmse;
  std::optional<double> lpips_published, lpips;  // where a network was given
  // Of `rmse`, as in ConsistencyMetrics.
  std::optional<double> rmse_difference, rmse_difference_low, rmse_difference_high;
  std::optional<int> difference_pairs;
  double coverage = 0;                                   // mean fraction of compared pixels
  std::vector<Metric> rmse_pairs_published, rmse_pairs;  // one for each pair in order of time

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("sequence", sequence);
    visit("gap", gap);
    visit("pairs", pairs);
    visit("rmse_published", rmse_published);
    visit("rmse", rmse);
    visit("lpips_published", lpips_published);
    visit("lpips", lpips);
    visit("rmse_difference", rmse_difference);
    visit("rmse_difference_low", rmse_difference_low);
    visit("rmse_difference_high", rmse_difference_high);
    visit("difference_pairs", difference_pairs);
    visit("coverage", coverage);
    visit("rmse_pairs_published", rmse_pairs_published);
    visit("rmse_pairs", rmse_pairs);
  }
};

// A row of --controls that could not be made.
struct MissingControl {
  std::string sequence, why;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("sequence", sequence);
    visit("why", why);
  }
};

// What an evaluation measures of sequences of frames.
struct EvaluationMetrics {
  std::vector<ConsistencyMetrics> consistency;
  std::vector<FidelityRow> fidelity;
  std::vector<PairResult> pairs;  // of all sequences, by first frame
  // In place of consistency and pairs in mode stylegaussian.
  std::optional<std::vector<WarpedMetrics>> warped;
  std::optional<std::vector<MissingControl>> missing_controls;  // absent where none is missing

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("consistency", consistency);
    visit("fidelity", fidelity);
    visit("consistency_pairs", pairs);
    visit("warped", warped);
    visit("missing_controls", missing_controls);
  }
};

// A picture of the pair with the largest error, written beside the metrics of an evaluation.
struct HeatMapFile {
  std::string sequence;
  int gap = 0, from = 0, to = 0;
  std::string path;  // relative to the output folder
};

}  // namespace regrade
