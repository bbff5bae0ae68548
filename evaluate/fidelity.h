// Fidelity of a styled sequence to its style; temporal consistency alone would rank a grey
// video best.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/edge_map.h"
#include "evaluate/frame_source.h"
#include "evaluate/style_distance.h"
#include "kernels/base/progress.h"

namespace regrade {

// One row of the fidelity table. A metric is empty if its reference was not given.
struct FidelityRow {
  std::string sequence;

  // Mean over frames of the PSNR (dB) to the 2D method's version of the frame, both clipped to
  // [0, 1]; identical frames are excluded from the mean (+inf if all are identical).
  std::optional<double> psnr_to_2d_db;

  // Mean over frames of the perceptual distance (LPIPS, Zhang et al. 2018) to the 2D method's
  // version; 0 for identical images.
  std::optional<double> lpips_to_2d;

  // Mean over frames of GradientCorrelation with the unstyled frame, in [-1, 1]: 1 if all edges
  // are preserved and none (such as noise) is added.
  std::optional<double> structure;

  // Circular standard deviation of the CIELAB hue weighted by chroma (radians), and mean chroma
  // (CIELAB units), over all pixels of all frames: see EQ(hue-chroma). hue_std is empty for
  // grey.
  std::optional<double> hue_std, hue_std_2d;  // of the sequence, of the 2D method's frames
  std::optional<double> chroma, chroma_2d;    // the same

  // Distance between the colours of all frames and of the style picture, in [0, 1] RGB units:
  // see EQ(sliced-wasserstein).
  std::optional<double> sliced_wasserstein_to_style;

  // Mean over frames of the SSIM of edge maps with the unstyled frame's, see EQ(ssim).
  std::optional<double> edge_ssim;

  // Distances to the style picture by networks: see StyleDistances.
  std::optional<double> gram_to_style, frechet_to_style, embedding_to_style;

  // Mean over frames of the perceptual distance to the unstyled frame, and with it and
  // frechet_to_style ArtFidLike.
  std::optional<double> lpips_to_unstyled, artfid_like;
};

// References for the metrics of a sequence; each may be empty (null, count 0).
struct FidelityTargets {
  FrameSource views_2d;          // the 2D method's version of each frame
  FrameSource transmittance;     // one channel: pixels above 0.5 show no scene and are excluded
                                 // from psnr_to_2d_db
  const Image* style = nullptr;  // the style picture
  std::function<double(const Image&, const Image&)> perceptual;  // see PairNetwork::Distance
  FrameSource unstyled = {};                                     // each frame before styling
  bool only_psnr = false;                                        // measures nothing else
  EdgeMapFunction edges = {};
  std::shared_ptr<const StyleFeatures> style_features = nullptr;
};

// One row for each sequence, in one pass: a frame of `targets` is read once for all of them,
// and what is measured of the 2D method's frame is not measured again of a sequence that has
// it. Errors (kInput): counts or sizes that differ. A few frames of each source are in memory,
// which are read from one thread. Progress counts frames of all sequences.
std::vector<FidelityRow> MeasureFidelities(const std::vector<NamedFrameSource>& sequences,
                                           const FidelityTargets& targets,
                                           const ProgressFunction& progress = {});

FidelityRow MeasureFidelity(const NamedFrameSource& sequence, const FidelityTargets& targets,
                            const ProgressFunction& progress = {});

}  // namespace regrade
