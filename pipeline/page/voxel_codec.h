// Packs the voxels of a page's field.
//
// Sections: "mask" (page_order.h); "density" (see EQ(page-density)); "color" (see
// EQ(page-color-code)); and of background spheres "sphere_mask" (a bit for each texel of the
// map, [2R, R], the lowest bit first), "sphere_density" and "sphere_color" of texels [columns,
// layers]. Numbers are packed as EQ(page-prediction) says.
//
// The field that comes out holds what a graphics processor holds: densities in half precision,
// in units of one over a voxel's width, coefficients in the 128 bits of a voxel, and spheres'
// coefficients of 8 bits, each channel with a scale.
#pragma once

#include <vector>

#include "pipeline/page/field_codec.h"

namespace regrade {

// See EncodeField, DecodeField, RecordsInPageOrder and ColorWeights.
PageField EncodeVoxels(const RadianceField& field, double step);
RadianceField DecodeVoxels(const PageField& page);
PageRecords VoxelsInPageOrder(const PageField& page, const Geometry& geometry);
std::vector<float> OpacityOfVoxels(const Geometry& geometry);

}  // namespace regrade
