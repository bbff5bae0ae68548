// Which regions of a scene take which of several style pictures.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stylize/image/masked_stylizer.h"
#include "stylize/image/region_features.h"
#include "stylize/image/region_mixture.h"

namespace regrade {

// EQ(region-match): the photos' features together are a mixture of kSceneRegions parts, those
// of each style picture one of kStyleRegions. Part k of the scene takes the style with the part
// at the least distance d, the root of c_kl of EQ(mixture-transport); its margin is 1 - d / d',
// d' the least distance of another style. A style's share in a pixel is the sum of the shares
// of its parts, see EQ(gaussian-mixture), given the picture's edges by EQ(guided-filter). Only
// parts with a margin of kDeciding have shares, or the one of largest margin of each style:
// what is between is often the border of two regions, and belongs to the nearest parts.
inline constexpr int kSceneRegions = 8, kStyleRegions = 3;
inline constexpr double kDeciding = 0.4;
// A part with less is unsure, and matching is refused where unsure parts have more weight.
inline constexpr double kLeastMargin = 0.2, kMostUnsure = 0.05;

struct RegionMatch {
  RegionMixture scene;
  RegionMixture deciding;  // of these, those that have shares
  std::vector<int> style_of_deciding;
  std::vector<int> style_of_part;
  std::vector<double> margin_of_part;
  std::vector<double> weight_of_style;  // of the scene's pixels; they sum to 1

  double Unsure() const;  // weight of parts with less than kLeastMargin
  double Margin() const;  // the least of the parts with a weight of at least kMostUnsure
};

// Of at least two styles.
RegionMatch MatchRegions(const std::vector<PictureFeatures>& photos,
                         const std::vector<PictureFeatures>& styles);

// [styles] of [H, W, 1]: they sum to 1 at each pixel. A style that has no pixel above 1/2 has
// none at all. Any picture of the scene, photo or render.
std::vector<Image> RegionCoverage(const RegionMatch& match, const RegionFeatures& features,
                                  const Image& picture);

}  // namespace regrade
