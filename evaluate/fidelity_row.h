// What fidelity.h measures, as plain data; its JSON is made by
// pipeline/workspace/metrics_json.h.
#pragma once

#include <optional>
#include <string>

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

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("sequence", sequence);
    visit.OrNull("psnr_to_2d_db", psnr_to_2d_db);
    visit("lpips_to_2d", lpips_to_2d);
    visit("structure", structure);
    visit.OrNull("hue_std", hue_std);
    visit.OrNull("hue_std_2d", hue_std_2d);
    visit.OrNull("chroma", chroma);
    visit.OrNull("chroma_2d", chroma_2d);
    visit.OrNull("sliced_wasserstein_to_style", sliced_wasserstein_to_style);
    visit("edge_ssim", edge_ssim);
  }
};

}  // namespace regrade
