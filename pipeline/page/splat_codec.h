// Packs the splats of a page's field.
//
// Sections: "coarse_shape" and "coarse_color" of the splats that come first, "shape" and
// "color" of the others. A shape is ten numbers, see EQ(page-splat); a colour is as those of
// voxels, see EQ(page-color-code). Numbers are packed as EQ(page-prediction) says, those of
// each section by themselves.
//
// In the header "splats" has how many come first ("coarse"), the "fit_pixel" (see
// SplatOptions), the "near_plane" and the "blur" of their pictures, and the steps of the
// numbers.
#pragma once

#include <vector>

#include "pipeline/page/field_codec.h"

namespace regrade {

// See EncodeField, DecodeField, RecordsInPageOrder and ColorWeights.
PageField EncodeSplats(const RadianceField& field, double step);
RadianceField DecodeSplats(const PageField& page);
PageRecords SplatsInPageOrder(const PageField& page, const Geometry& geometry);
// Opacity times the area of the two longest axes.
std::vector<float> LightOfSplats(const Geometry& geometry);

}  // namespace regrade
