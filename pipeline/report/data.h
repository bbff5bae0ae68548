// What a run has to say for itself, as plain data: report.json (schema 1) and report.html are
// both written from these structs, so they cannot disagree.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/workspace/metric.h"

namespace regrade {

struct PhotosReport {
  int given = 0;
  int used = 0;
  int registered = 0;
  std::vector<PhotoStatus> statuses;  // one for each given file
};

struct PoseStageReport {
  double seconds = 0;
  Metric reprojection_px;
  int64_t points = 0;
  int models_found = 0;
  // Of looking for points under poses that came without; none where it was not done.
  std::optional<double> tracks_seconds, tracks_cpu_seconds;
};

struct ReconstructReport {
  double seconds = 0;
  int64_t voxels = 0;
  Metric psnr_train_db, psnr_heldout_db, ssim_heldout;
  std::vector<std::string> heldout;                       // the user's file names
  std::vector<std::pair<int64_t, double>> psnr_at_steps;  // dB on the rays of the last steps
  // Steps of voxels that were not taken, their gradient being no number.
  std::optional<int64_t> rejected_voxels;
};

struct Style2dReport {
  double seconds = 0;
  std::string method;
  std::vector<std::string> notices;  // what a person should know: a grey or constant picture
};

// How far apart neighbouring pixels' colours became, against K = the bound times how far they
// were; pairs by what the guarantee asks for and they lack.
struct VarianceMetrics {
  struct Group {
    std::string name;  // "inside" the premises | "clamp" | "open"
    int64_t pairs = 0;
    int64_t above = 0;  // further apart than K times before
    Metric gain;        // mean distance after over mean distance before
    Metric largest_excess;
  };
  std::vector<Group> groups;
  Metric largest_share;  // of the bound that holds inside the premises; at most 1
};

struct StylizeReport {
  double seconds = 0;
  int steps = 0;
  Metric k_est, bound, local_lipschitz_sampled;  // slopes in (SH, scaled position) space
  Metric psnr_to_2d_db;             // styled frames against the 2D method on our renders
  Metric psnr_to_2d_photos_db;      // ... against the 2D method on the photos
  Metric linear_map_psnr_to_2d_db;  // what the better of two linear colour maps reaches
  Metric local_lipschitz_max;       // the largest that climbing from the voxels finds
  // Of the colour map that it started from; and where it is steepest, with the position held
  // and with the coefficients held.
  Metric local_lipschitz_of_map, local_lipschitz_along_coefficients,
      local_lipschitz_along_position;
  std::vector<std::pair<int64_t, double>> bound_at_steps;  // while it was learned
  std::optional<VarianceMetrics> variance;
  std::vector<std::string> notices;       // of the colour map and of learning
  std::optional<int64_t> rejected_steps;  // not taken, the gradient being no number
};

struct RenderReport {
  double seconds = 0;
  int frames = 0;
  Metric frames_per_second;
  int film_width = 0, film_height = 0;  // pixels
};

struct EvaluateReport {
  double seconds = 0;
  std::string flow;  // "dis-medium"
  std::string mask;  // "lai2018"
  // On which frames neighbouring views were compared, where these are not the views' own.
  std::string comparison_note;
};

// Only the stages that a command has run are there.
struct StagesReport {
  std::optional<PoseStageReport> pose;
  std::optional<ReconstructReport> reconstruct;
  std::optional<Style2dReport> style_2d;
  std::optional<StylizeReport> stylize;
  std::optional<RenderReport> render;
  std::optional<EvaluateReport> evaluate;
};

// Temporal consistency of a sequence over frames `gap` apart.
struct ConsistencyMetrics {
  std::string sequence;  // "source" | "views_2d" | "styled" | "photos"
  int gap = 1;
  int pairs = 0;                           // looked at, undefined ones included
  int undefined_pairs = 0;                 // nothing to compare; in no mean
  Metric tc_psnr_mean_db;                  // mean of the pairs' dB
  Metric tc_psnr_of_mean_db;               // dB of the pairs' mean squared error
  Metric coverage;                         // mean share of valid pixels
  std::vector<Metric> tc_psnr_pairs_db;    // one for each pair in order of time; may be empty
  Metric tc_psnr_low_db, tc_psnr_high_db;  // the mean of dB lies between with 95 %
  std::string heat_map;   // picture of the worst pair, relative to the folder; may be empty
  int heat_map_from = 0;  // the pair's first frame
};

// What one pair of one sequence says, and which pixels had no say in it.
struct PairMetrics {
  std::string sequence;
  int from = 0, to = 0;  // frames, counted from 0
  Metric error;          // mean square of a trusted pixel and channel, white = 1
  Metric tc_psnr_db;
  double coverage = 0;        // share of the frame that was compared
  bool low_coverage = false;  // so little that the figure says little
  // Pixels by what speaks against them.
  int64_t flow_not_finite = 0, out_of_frame = 0, disoccluded = 0, motion_boundary = 0,
          colour_not_finite = 0;
};

// How near a sequence is to what the 2D method made, and how much colour it kept.
struct FidelityMetrics {
  std::string sequence;
  Metric psnr_to_2d_db;
  Metric hue_std, hue_std_2d;  // radians
  Metric chroma, chroma_2d;    // CIELAB
  Metric sliced_wasserstein_to_style;
  std::optional<double> lpips_to_2d;  // where a network was given
  std::optional<double> structure;    // where the unstyled frames are known
};

// What one value of a parameter costs and buys, measured on this machine. Rows of one plane
// compare with each other.
struct CostRow {
  std::string benchmark;  // "fit"
  std::string
      parameter;        // the option, "fit-steps"; empty for what all others are compared with
  std::string setting;  // "300"
  std::string measure;  // what accuracy is: "held-out PSNR"
  std::string unit;     // "dB"
  int repeats = 1;
  // Medians, and half of what lies between the least and the most.
  Metric seconds, seconds_spread, cpu_seconds, cpu_spread, accuracy, accuracy_spread;
  Metric error;                  // against the parameter's accurate end; positive is worse
  bool on_pareto_front = false;  // nothing is as accurate in less time
  std::string dominated_by;      // what is better beyond the spreads; may be empty
};

// An option in effect, as run.json has it.
struct OptionValue {
  std::string name, value;
};

struct RunReport {
  std::string version;               // of regrade
  std::vector<std::string> command;  // argv; empty for frames that any program has made
  std::string preset, device;
  uint64_t seed = 0;
  double seconds = 0;
  Metric peak_memory_mb;
  // By stage, all threads and the programs that it started; of its last start.
  std::vector<std::pair<std::string, double>> cpu_seconds;
  std::optional<PhotosReport> photos;
  std::vector<EffectReport> effects;
  StagesReport stages;
  std::vector<ConsistencyMetrics> consistency;
  std::vector<PairMetrics> pairs;  // of all sequences, by first frame
  std::vector<FidelityMetrics> fidelity;
  std::vector<CostRow> costs;
  std::vector<OptionValue> options;   // of run.json; shown on the page only
  std::vector<OptionValue> versions;  // of this program's parts and helpers
};

// A picture of the pair with the largest error, written beside an evaluation's figures.
struct HeatMapFile {
  std::string sequence;
  int gap = 0, from = 0, to = 0;
  std::string path;  // relative to the output folder
};

}  // namespace regrade
