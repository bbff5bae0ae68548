// Whether a styled sequence still has the style: consistency alone is won by a grey video.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"

namespace regrade {

// One line of the fidelity table. A figure is empty when what it compares with was not given.
struct FidelityRow {
  std::string sequence;

  // Mean over frames of the frames' PSNR against what the 2D method made of the same frame;
  // both clipped to [0, 1]; identical frames are left out of the mean (all identical: +inf).
  std::optional<double> psnr_to_2d_db;

  // Mean over frames of how different they look from the 2D method's (LPIPS), by the network
  // that was given; 0 for the same pictures.
  std::optional<double> lpips_to_2d;

  // Mean over frames of GradientCorrelation with the unstyled frame: 1 where edges are where
  // they were and none came to them, as noise does.
  std::optional<double> structure;

  // Circular standard deviation of the CIELAB hue weighted by chroma (radians), and mean chroma
  // (CIELAB units), over all pixels of all frames: see kernels/image/hue_chroma.h. hue_std is
  // empty for grey.
  std::optional<double> hue_std, hue_std_2d;  // of the sequence, of the 2D method's frames
  std::optional<double> chroma, chroma_2d;    // likewise

  // Distance of the colours of all frames to the style picture's, see sliced_wasserstein.h.
  std::optional<double> sliced_wasserstein_to_style;
};

// What a sequence is measured against; each member may be left empty (null, count 0).
struct FidelityTargets {
  FrameSource views_2d;          // the 2D method's version, frame for frame
  FrameSource transmittance;     // one channel: pixels above 0.5 show no scene and are left
                                 // out of psnr_to_2d_db
  const Image* style = nullptr;  // the style picture
  std::function<double(const Image&, const Image&)> perceptual;  // see PairNetwork::Distance
  FrameSource unstyled = {};  // what was styled, frame for frame
};

// Errors (kInput): counts or sizes that differ. One frame of each source is held at a time.
// Progress counts frames.
FidelityRow MeasureFidelity(const NamedFrameSource& sequence, const FidelityTargets& targets,
                            const ProgressFunction& progress = {});

}  // namespace regrade
