// Packs a radiance field for a page, and unpacks it as the page does.
//
// Sections, each compressed by itself (see deflate.h): "tree" or "mask" (page_order.h);
// "density" (see EQ(page-density)); "color" (see EQ(page-color-code)); and of background
// spheres "sphere_mask" (a bit for each texel of the map, [2R, R], the lowest bit first),
// "sphere_density" and "sphere_color" of texels [columns, layers]. Numbers are packed as
// EQ(page-prediction) says. What is no array is in the header, a JSON object.
//
// The field that comes out holds what a graphics processor holds: densities in half precision,
// in units of one over a voxel's width, coefficients in the 128 bits of a voxel, and spheres'
// coefficients of 8 bits, each channel with a scale.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/ndc.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/page_order.h"

namespace regrade {

inline constexpr int kPageFormat = 2;

struct PageSection {
  std::string name;
  std::string packed;  // compressed
};

struct PageField {
  JsonValue header;
  std::vector<PageSection> sections;

  size_t bytes() const {
    size_t sum = 0;
    for (const PageSection& section : sections) sum += section.packed.size();
    return sum;
  }
};

// `step`: the step of rounded coefficients, in units of coefficients.
PageField EncodeField(const RadianceField& field, double step);

// Has passed Validate. Throws Error(kInput) for anything else than what EncodeField makes, with
// memory in proportion to what the sections unpack to.
RadianceField DecodeField(const PageField& page);

// The voxels of a page in its order: which they are in `geometry`, that of the field that was
// encoded or decoded, and from which others they are predicted.
struct PageVoxels {
  std::vector<int64_t> voxel;
  std::vector<EarlierVoxels> earlier;
};
PageVoxels VoxelsInPageOrder(const PageField& page, const Geometry& geometry);

}  // namespace regrade
