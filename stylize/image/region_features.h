// What a pixel's surroundings look like, for telling regions of pictures apart.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "stylize/image/region_mixture.h"

namespace regrade {

class OnnxNetwork;

// Features of a small copy of a picture, in rows from the top.
struct PictureFeatures {
  int width = 0, height = 0;
  FeatureRows rows;  // [height * width, dimensions]
};

// EQ(region-features): of a copy whose longer side is kRegionSide pixels,
//   (g_1, g_w / 2, v / 5[, e]),  g_s = (L / 2, a, b) / 100 under a Gaussian of s pixels,
// w a sixteenth of the longer side: the colour at a pixel, in CIELAB with lightness at half,
// for shadows change it; the colour around it, which tells a pale tile of a blue wall from one
// of a red floor; and the height v in the picture, 0 at the bottom, 1 at the top. With a
// network also e, its features in the kNetworkFeatures directions of largest variance over the
// example pictures, scaled by one factor to a total variance of kNetworkVariance there.
inline constexpr int kRegionSide = 96;
inline constexpr int kNetworkFeatures = 4;
inline constexpr double kNetworkVariance = 0.04;

class RegionFeatures {
 public:
  // `network` is an ONNX file (image -> feat, [1, C, h, w] of any size), or empty. Throws
  // Error(kExternalProgram) naming it. There must be an example.
  RegionFeatures(const std::string& network, const std::vector<Image>& examples);
  ~RegionFeatures();

  // `picture` [H, W, 1, 3 or 4].
  PictureFeatures Of(const Image& picture) const;

 private:
  std::unique_ptr<OnnxNetwork> network_;
  std::vector<float> mean_, directions_;  // of the network's features: [C], [4, C]
};

}  // namespace regrade
