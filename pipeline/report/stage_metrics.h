// What each stage measures: the stage fills its struct, its record stores it and the report
// shows it. See pipeline/workspace/metric.h.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/workspace/metric.h"

namespace regrade {

// Values over steps.
using Curve = std::vector<std::pair<int64_t, double>>;

// Time of a stage, from its record.
struct RecordedTime {
  double seconds = 0;
  // All threads and the programs started; of the last start of a stage that was interrupted.
  std::optional<double> cpu_seconds;
};

// Time of the search for points under given poses.
struct TracksMetrics {
  std::optional<double> seconds, cpu_seconds;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("seconds", seconds, {.label = "search for points", .unit = "s", .decimals = 1});
    visit("cpu_seconds", cpu_seconds);
  }
};

struct PoseStageReport {
  RecordedTime time;
  std::string given_poses;  // the file of given poses; empty where COLMAP found them
  // Of COLMAP: its version, the strategy that succeeded, its camera model. Empty for given
  // poses.
  std::string colmap, strategy, lens;
  std::vector<std::string> attempts;  // COLMAP's runs, each with its outcome
  std::vector<std::string> notices;   // for the user: for example that the lens was simplified
  std::optional<int> photo_masks;
  int registered = 0;
  int64_t points = 0;
  Metric reprojection_px;
  int models_found = 1;
  std::optional<TracksMetrics> tracks;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("given_poses", given_poses, {.label = "given poses", .optional = true});
    visit("colmap", colmap, {.label = "COLMAP", .optional = true});
    visit("strategy", strategy, {.label = "strategy", .optional = true});
    visit("lens", lens, {.label = "camera model", .optional = true});
    visit("attempts", attempts, {.label = "attempts"});
    visit("notices", notices);
    visit("photo_masks", photo_masks, {.label = "masks"});
    visit("registered", registered, {.label = "registered photos"});
    visit("points", points, {.label = "points"});
    visit("reprojection_px", reprojection_px, {.label = "reprojection error", .unit = "px"});
    visit("models_found", models_found);
    visit("tracks", tracks);
  }
};

// Of a field that `regrade refine` made of the first one, in blocks.
struct RefineReport {
  std::string settings;  // their hash: the same are not applied twice
  int blocks = 0;
  double seconds = 0;     // of all blocks together
  Metric peak_memory_gb;  // of 10^9 bytes: the most that a process had that made one
  Metric psnr_before_db;  // of the first field on held-out photos of the same size
  // On held-out photos, of all pixels together: within 8 pixels of where two blocks meet on
  // a surface, and elsewhere.
  Metric psnr_at_seams_db, psnr_elsewhere_db;
  Metric seams_before_db, elsewhere_before_db;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("settings", settings);
    visit("blocks", blocks, {.label = "blocks"});
    visit("seconds", seconds, {.label = "all blocks", .unit = "s", .decimals = 0});
    visit("peak_memory_gb", peak_memory_gb, {.label = "most memory of a block", .unit = "GB"});
    visit("psnr_before_db", psnr_before_db, {.label = "before, held out", .unit = "dB"});
    visit("psnr_at_seams_db", psnr_at_seams_db, {.label = "at seams", .unit = "dB"});
    visit("psnr_elsewhere_db", psnr_elsewhere_db, {.label = "elsewhere", .unit = "dB"});
    visit("seams_before_db", seams_before_db, {.label = "at seams before", .unit = "dB"});
    visit("elsewhere_before_db", elsewhere_before_db,
          {.label = "elsewhere before", .unit = "dB"});
  }
};

struct ReconstructReport {
  RecordedTime time;
  std::string device;
  // Of --preset paper: "llff: the cameras all look one way", and what was set by hand.
  std::string paper_config;
  std::vector<std::string> not_to_the_letter;
  std::optional<int> finest_grid;  // voxels a side
  int64_t rays = 0;
  int sh_degree = 0;
  // One of both kinds; `finest_grid` is of voxels.
  std::optional<int64_t> voxels, splats;
  std::optional<int64_t> background_texels;
  Metric psnr_train_db;  // of the rays of the last steps
  // Of some rendered training views; see MeasuredTrainingViews.
  Metric ssim_train, detail_kept_train, detail_error_train;
  int64_t rejected_voxels = 0;  // updates of records that were refused: gradient not finite
  Metric psnr_heldout_db, ssim_heldout, detail_kept_heldout, detail_error_heldout;
  std::string sharpness;             // SharpnessWord of detail_kept, held out, or else training
  std::vector<std::string> heldout;  // the user's file names
  Curve psnr_at_steps;               // dB on the rays of the last steps
  std::optional<RefineReport> refined;  // of a field that was refined in blocks

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("device", device);
    visit("paper_config", paper_config,
          {.label = "configuration of the paper", .optional = true});
    if (!paper_config.empty())
      visit("not_to_the_letter", not_to_the_letter, {.label = "not to the letter"});
    visit("finest_grid", finest_grid);
    visit("rays", rays);
    visit("sh_degree", sh_degree, {.label = "degree of view dependence"});
    visit("voxels", voxels, {.label = "voxels"});
    visit("splats", splats, {.label = "splats"});
    visit("background_texels", background_texels, {.label = "background texels"});
    visit("psnr_train_db", psnr_train_db, {.label = "PSNR, training", .unit = "dB"});
    visit("ssim_train", ssim_train, {.label = "SSIM, training", .decimals = 3});
    visit("detail_kept_train", detail_kept_train, {.label = "detail kept, training"});
    visit("detail_error_train", detail_error_train,
          {.label = "its error", .unit = "levels", .decimals = 1});
    visit("rejected_voxels", rejected_voxels);
    visit("psnr_heldout_db", psnr_heldout_db, {.label = "PSNR, held out", .unit = "dB"});
    visit("ssim_heldout", ssim_heldout, {.label = "SSIM, held out", .decimals = 3});
    visit("detail_kept_heldout", detail_kept_heldout, {.label = "detail kept, held out"});
    visit("detail_error_heldout", detail_error_heldout,
          {.label = "its error", .unit = "levels", .decimals = 1});
    visit("sharpness", sharpness, {.label = "sharpness", .optional = true});
    visit("heldout", heldout, {.label = "photos held out"});
    visit("psnr_at_steps", psnr_at_steps);
    visit("refined", refined);
  }
};

// The 2D method of a LUT, and of what `regrade retouch` makes of an edit.
inline constexpr char kLutMethod[] = "lut";

struct Style2dReport {
  RecordedTime time;
  std::string method;
  int views = 0;                     // that it has styled
  std::vector<std::string> notices;  // for the user: for example a grey style picture

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("method", method, {.label = "method"});
    visit("views", views, {.label = "views"});
    visit("notices", notices);
  }
};

// Differences of pairs of pixels before and after styling; see stylize's volume_variance.h.
struct VarianceGroupMetrics {
  int64_t pairs = 0;
  int64_t above = 0;  // pairs that differ by more than the bound times their difference before
  Metric gain;        // mean difference after over mean difference before
  Metric largest_excess;  // over the bound

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("pairs", pairs);
    visit("above", above);
    visit("gain", gain);
    visit("largest_excess", largest_excess);
  }
};

// Grouped by which premise of the guarantee is violated.
struct VarianceMetrics {
  VarianceGroupMetrics valid;        // none
  VarianceGroupMetrics clamped;      // a colour is clamped
  VarianceGroupMetrics transparent;  // light passes through the scene
  Metric largest_fraction_of_bound;  // where nothing is clamped; at most 1
  // Light from background spheres; voxels that are not wholly of the styled object.
  std::optional<VarianceGroupMetrics> spheres = {}, partial = {};

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("spheres", spheres);
    visit("partial", partial);
    visit("valid", valid);
    visit("clamped", clamped);
    visit("transparent", transparent);
    visit("largest_fraction_of_bound", largest_fraction_of_bound);
  }
};

struct StylizeReport {
  RecordedTime time;
  std::string device;  // empty if there was nothing to train
  int steps = 0;
  int64_t rejected_steps = 0;  // steps that were refused: gradient not finite
  Metric psnr_train_db;
  // Lipschitz constants in the space of SH coefficients and scaled position: estimated from
  // colour statistics; the network's certified bound; the largest local constant among sampled
  // voxels, and after gradient ascent from there.
  Metric k_est, bound, local_lipschitz_sampled, local_lipschitz_max;
  // Of the initial colour map; and at the steepest voxel with the position held fixed and with
  // the coefficients held fixed.
  Metric local_lipschitz_of_map, local_lipschitz_along_coefficients,
      local_lipschitz_along_position;
  Curve bound_at_steps;
  // 3 Q / B of a step, of the paper's sum over what the network maps.
  std::optional<double> loss_balance;
  std::optional<int64_t> object_voxels;
  // Of neighbouring pixels of a view, and of pixels of two views that see one point.
  std::optional<VarianceMetrics> variance, variance_across_views;
  std::vector<std::string> notices;  // about the colour map and the training
  // Options of the recipe, if the preset is that of the paper.
  std::optional<std::vector<std::string>> not_to_the_letter;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("device", device, {.optional = true});
    visit("not_to_the_letter", not_to_the_letter, {.label = "not to the letter"});
    visit("steps", steps, {.label = "steps"});
    visit("rejected_steps", rejected_steps);
    visit("psnr_train_db", psnr_train_db, {.label = "PSNR, training", .unit = "dB"});
    visit("bound", bound, {.label = "Lipschitz bound"});
    visit("local_lipschitz_sampled", local_lipschitz_sampled,
          {.label = "largest local Lipschitz constant, sampled"});
    visit("local_lipschitz_max", local_lipschitz_max, {.label = "after gradient ascent"});
    visit("k_est", k_est, {.label = "K_est, from the colours"});
    visit("local_lipschitz_of_map", local_lipschitz_of_map);
    visit("local_lipschitz_along_coefficients", local_lipschitz_along_coefficients);
    visit("local_lipschitz_along_position", local_lipschitz_along_position);
    visit("bound_at_steps", bound_at_steps);
    visit("loss_balance", loss_balance, {.label = "3 Q / B of the summed loss", .decimals = 3});
    visit("object_voxels", object_voxels, {.label = "voxels of the object"});
    visit("variance", variance);
    visit("variance_across_views", variance_across_views);
    visit("notices", notices);
  }
};

struct FilmSize {
  int width = 0, height = 0;  // pixels

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("width", width);
    visit("height", height);
  }
};

// Fractions, in [0, 1], of pixels with a surface that fewer than three fitted photos see; see
// evaluate's seen_by_few.h.
struct SeenByFewMetrics {
  Metric film;                 // mean over its frames
  Metric worst_frame;          // of the film
  int worst_frame_number = 0;  // its index
  std::vector<Metric> photos;  // at each photo's position

  // "seen by fewer than three photos: 41 % of the film (72 % of frame 12)"; empty without
  // `film`.
  std::string Sentence() const;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("film", film);
    visit("worst_frame", worst_frame);
    visit("worst_frame_number", worst_frame_number);
    visit("photos", photos);
  }
};

struct RenderReport {
  RecordedTime time;
  std::string device;
  int frames = 0;
  int path_frames = 0;  // of these, on disk along the film's path: the film is measured there
  int film_frames = 0;
  double film_seconds = 0;
  // The path's least transmittance, and its largest distance to a photo, in the photos'
  // spacing.
  Metric path_transmittance, path_photo_distance;
  FilmSize film;
  double strength = 1;  // of the style, see EQ(style-mix)
  Metric frames_per_second;
  SeenByFewMetrics seen_by_few;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("device", device);
    visit("frames", frames, {.label = "frames"});
    visit("path_frames", path_frames);
    visit("film_frames", film_frames, {.label = "frames of the film"});
    visit("film_seconds", film_seconds,
          {.label = "length of the film", .unit = "s", .decimals = 1});
    visit("path_transmittance", path_transmittance,
          {.label = "least transmittance of its path"});
    visit("path_photo_distance", path_photo_distance,
          {.label = "largest distance of its path to a photo", .unit = "photo spacings"});
    visit("film", film);
    visit("strength", strength, {.label = "strength of the style"});
    visit("frames_per_second", frames_per_second, {.label = "speed", .unit = "frames/s"});
    visit("seen_by_few", seen_by_few);
  }
};

struct EvaluateReport {
  RecordedTime time;
  std::string flow;             // "dis-medium"
  std::string mask;             // "lai2018"
  std::string warp, error_per;  // "later", "channel"
  std::string protocol;         // whose values these are; empty for none
  // Which frames stand for neighbouring views that differ in size or lens; else empty.
  std::string comparison_note;
  // Styled frames against the 2D method on the photos; of an edit of single photos, on these.
  Metric psnr_to_2d_photos_db;
  Metric linear_map_psnr_to_2d_db;  // of the better of two linear colour maps
  // Of renders without style to the photos, as those of ReconstructReport; where a network was
  // given.
  std::optional<double> lpips_heldout = {}, lpips_train = {};
  // Of an edit of single photos: the share of the measured pixels that these photos see. What
  // they do not see is in no fidelity.
  std::optional<double> edit_seen = {};
  // Options of the protocol, if the preset is that of the paper.
  std::optional<std::vector<std::string>> not_to_the_letter = {};

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("flow", flow, {.label = "optical flow"});
    visit("mask", mask, {.label = "mask"});
    visit("warp", warp, {.label = "warped frame", .optional = true});
    visit("error_per", error_per, {.label = "error per", .optional = true});
    visit("protocol", protocol, {.label = "protocol", .optional = true});
    visit("not_to_the_letter", not_to_the_letter, {.label = "not to the letter"});
    visit("comparison_note", comparison_note, {.optional = true});
    visit("psnr_to_2d_photos_db", psnr_to_2d_photos_db,
          {.label = "PSNR to the styled photos", .unit = "dB"});
    visit("edit_seen", edit_seen, {.label = "share that the edited photo sees"});
    visit("linear_map_psnr_to_2d_db", linear_map_psnr_to_2d_db,
          {.label = "PSNR of the best linear colour map", .unit = "dB"});
    visit("lpips_heldout", lpips_heldout,
          {.label = "LPIPS to the photos, held out", .decimals = 3});
    visit("lpips_train", lpips_train,
          {.label = "LPIPS to the photos, training", .decimals = 3});
  }
};

// Only the finished stages are there.
struct StagesReport {
  std::optional<PoseStageReport> pose;
  std::optional<ReconstructReport> reconstruct;
  std::optional<Style2dReport> style_2d;
  std::optional<StylizeReport> stylize;
  std::optional<RenderReport> render;
  std::optional<EvaluateReport> evaluate;

  // Calls visit(name, optional stage) in the order of the run.
  template <typename Visit>
  void ForEach(Visit&& visit) {
    visit("pose", pose);
    visit("reconstruct", reconstruct);
    visit("style_2d", style_2d);
    visit("stylize", stylize);
    visit("render", render);
    visit("evaluate", evaluate);
  }
};

}  // namespace regrade
