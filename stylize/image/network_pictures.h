// Pictures on their way into networks and out of them: sizes that networks can take, and back.
#pragma once

#include <functional>
#include <string>

#include "kernels/scene/image.h"
#include "stylize/image/feature_map.h"

namespace regrade {

FeatureMap MapOf(const Image& image);            // three channels
Image ClippedImageOf(const FeatureMap& map);     // to [0, 1]
inline constexpr int kSmallestNetworkSide = 16;  // pixels; reflects at the edges of 16 / 16

// The picture that networks see: longer side cut to `max_side`, sides cut to multiples of
// `multiple`, none below `smallest`.
Image Working(const Image& image, int max_side, int multiple,
              int smallest = kSmallestNetworkSide);

// Reflected at right and bottom (the edge itself not repeated) to the next multiple of
// `multiple`, which must be at most either side.
FeatureMap Padded(const FeatureMap& map, int multiple);

// Without the up to `spare` rows and columns that are too many at right and bottom. Any other
// size, or other than three channels, is an error naming `path`.
FeatureMap Cropped(const FeatureMap& map, int width, int height, int spare,
                   const std::string& path);

// A styled picture of `small` at the size of `photo`, of which `small` is a smaller copy, with
// the photo's edges: EQ(guided-filter) with radius 30 and eps 0.02^2, whose coefficients are
// enlarged and meet the photo's own detail.
Image WithEdgesOf(const Image& photo, const Image& small, const Image& styled);

// What Stylize of view_stylizer.h guarantees, by a method that gives a picture of any size back
// at that size: a photo whose longer side is above `max_side` is restyled small, and
// WithEdgesOf brings the result to its size.
Image StyledAtWorkingSize(const Image& view, int view_index, int max_side,
                          const std::function<Image(const Image&)>& restyled);

// Of many colours, for a first try of networks.
Image TrialPicture(int width, int height);

// Throws Error(kExternalProgram) naming `path` unless the map has this shape.
void CheckShape(const FeatureMap& map, int channels, int height, int width,
                const std::string& path);

// folder/nameLEVEL.onnx
std::string Numbered(const std::string& folder, const std::string& name, int level);

}  // namespace regrade
