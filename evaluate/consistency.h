// Temporal consistency: the PSNR between each frame and a later one, aligned by the motion
// between them.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency_report.h"
#include "evaluate/frame_source.h"
#include "evaluate/pair_motion.h"
#include "kernels/base/options.h"
#include "kernels/base/progress.h"

namespace regrade {

struct ConsistencyOptions {
  std::vector<int> gaps{1, 5};
  std::string mode = "lai2018";
  std::string flow = "dis-medium";
  std::string warp = "later", error_per = "channel";
  std::string lpips, edges;
  double min_coverage = 0.4;
  std::string controls = "off";  // the caller adds the sequences
  // Frames come in excerpts of that many, and pairs lie within one; 0: all are one sequence.
  // Not an option of the user: it follows from the frames.
  int excerpt = 0;
  // What --flow files:DIR calls the frames, if not 0, 1, ... (see flow_folder.h). Not an option
  // of the user either.
  std::vector<int64_t> flow_frames = {};

  bool HasControls() const { return controls != "off"; }
  bool HasControlField() const { return controls == "field"; }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("gaps", gaps,
         {.unit = "frames",
          .help = "distances between compared frames; 1 is the short range of the paper, 5 the "
                  "long range",
          .min = 1,
          .max = 100000});
    bind("mode", mode,
         {.help = "source of motion and mask: lai2018 and ruder2016 use estimated optical flow "
                  "with the mask of the named paper, geometry uses exact flow from depth and "
                  "cameras; stylegaussian moves frames forward and measures RMSE and, with "
                  "--lpips, LPIPS, as published and corrected",
          .choices = "lai2018|ruder2016|geometry|stylegaussian"});
    bind("flow", flow,
         {.help = "optical flow method for the reference frames: dis-ultrafast, dis-fast, "
                  "dis-medium, dis-tuned, farneback (relative times 1 : 1.3 : 5 : 25 : 16, "
                  "errors in COSTS.md); with OpenCV's optflow module deepflow, tvl1, pca-flow, "
                  "rlof; files:DIR reads 00000_00001.flo and 00001_00000.flo; onnx:FILE runs a "
                  "network with inputs named first and second, RGB from -1 to 1",
          .runs = "onnx:",
          .reads = "files:"});
    bind("warp", warp,
         {.help = "which frame of a pair is warped onto the other, where both are compared and "
                  "the mask is made: later as Lai et al. compute it, earlier as LipRF writes "
                  "it; not of mode stylegaussian",
          .choices = "later|earlier"});
    bind("error-per", error_per,
         {.help = "what a pair's squared error is divided by: the colour channels of the "
                  "compared pixels, or those pixels, which is 4.77 dB lower; not of mode "
                  "stylegaussian",
          .choices = "channel|pixel"});
    bind("lpips", lpips,
         {.help = "ONNX file of a perceptual distance network (LPIPS), with the inputs of "
                  "--flow onnx:FILE; compares each sequence with the 2D method's frames",
          .runs = "*"});
    bind(
        "edges", edges,
        {.help = "compares edges with the unstyled frames' by SSIM: gradient, or the ONNX file "
                 "of an edge network with one input, RGB from -1 to 1, and one output [1, 1, "
                 "height, width] from 0 to 1",
         .runs = "*|!gradient",
         .constant = true});
    bind(
        "min-coverage", min_coverage,
        {.unit = "fraction of pixels",
         .help =
             "flags pairs with a smaller fraction of comparable pixels; unrelated images reach "
             "0.35, neighbouring views of a scene 0.8",
         .min = 0,
         .max = 1,
         .constant = true});
    bind("controls", controls,
         {.help = "adds rows that bound the table: on adds one linear colour map, the styled "
                  "frames blurred and in grey, and for runs also the photos, the 2D method on "
                  "them and, in about a minute, the closest that colours of the scene can come "
                  "to it; field also adds, for runs, the naive way to style a scene: a field "
                  "fitted to the 2D method's pictures of the photos, with the options of the "
                  "scene's own fit and its time",
          .choices = "off|on|field"});
  }
};

// EQ(tc-psnr), Lai et al. 2018: e = sum_x |M(x) (O_b(x + f(x)) - O_a(x))|^2 / (C sum_x M(x)),
// over trusted pixels x of frame a and the C = 3 colour channels. f and M are flow from a to
// b and mask of the reference frames; O is sampled bilinearly with repeated border, values as
// given (white = 1, not clipped). b is the frame that is warped: the later one, or with
// `--warp earlier` the earlier one. `--error-per pixel` leaves C out: every value is 10 log10
// 3 = 4.77 dB lower.
//
// Compares frame i with frame i + gap of each sequence, for every i and gap within an excerpt.
// Flow and mask are estimated once per pair from the reference frames (the unstyled ones), so
// all sequences are measured on the same pixels; mode "geometry" takes them from `geometry`.
// Mode "stylegaussian" is that of warped_rows.h.
// Only a few frames are in memory at a time.
//
// Errors: kUsage for an unknown mode, a gap below 1, or a switch that the mode does not have;
// kInput if counts, sizes or channels of the frames differ, or if frames are too small for
// flow. Progress counts pairs.
ConsistencyReport EvaluateConsistency(const FrameSource& reference,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress = {},
                                      const GeometrySource& geometry = {});

// The same with motion from any source, which is asked for motion(j, i) where the earlier frame
// is warped; options.mode and options.flow are only reported.
ConsistencyReport EvaluateConsistency(int frames, const PairMotionFunction& motion,
                                      const std::vector<NamedFrameSource>& sequences,
                                      const ConsistencyOptions& options,
                                      const ProgressFunction& progress = {});

// The report for frames that cannot be compared: every pair counts as undefined, and `why` is
// each row's reason.
ConsistencyReport UndefinedConsistency(int frames,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyOptions& options,
                                       const std::string& why);

// Compares one pair: frames of one sequence, of the flow's size. `motion` leads from the pixels
// of `at` to positions in `warped`. Fills error, psnr_db, coverage and the counts.
PairResult ComparePair(const Image& at, const Image& warped, const PairMotion& motion,
                       bool per_pixel = false);

// Summarises the pairs of one sequence and gap.
ConsistencyRow Summarize(const std::string& sequence, int gap,
                         const std::vector<PairResult>& pairs);

}  // namespace regrade
