// Packs the splats of a field for a page, and unpacks them as the page does.
//
// A page's field is a header, a JSON object, and sections of bytes, each compressed by itself
// (see deflate.h): "coarse_shape" and "coarse_color" of the splats that come first, "shape" and
// "color" of the others. A shape is ten numbers, see EQ(page-splat); for colours see
// EQ(page-color-code). Numbers are packed as EQ(page-prediction) says, those of each section by
// themselves.
//
// In the header "splats" has how many there are ("count") and how many come first ("coarse"),
// the "fit_pixel" (see SplatOptions), the "near_plane" and the "blur" of their pictures, and
// the steps of the numbers.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/value_codec.h"

namespace regrade {

inline constexpr int kPageFormat = 3;
inline constexpr int64_t kMaxPageSplats = int64_t{1} << 26;

struct PageSection {
  std::string name;
  std::string packed;  // compressed
};

struct PageField {
  JsonValue header;
  std::vector<PageSection> sections;

  int64_t count() const { return header.At("splats").At("count").AsInt(); }
  size_t bytes() const {
    size_t sum = 0;
    for (const PageSection& section : sections) sum += section.packed.size();
    return sum;
  }
};

// Of rounded coefficients, in their units. With twice of it the still life's draft is 5 to 8 dB
// worse, for 3.6 bytes a splat less.
inline constexpr double kColorStep = 0.01;

// A field of splats. Throws Error(kInput) where nothing of it is seen.
PageField EncodeField(const RadianceField& field, double step = kColorStep);

// Has passed Validate. Throws Error(kInput) for anything else than what EncodeField makes, with
// memory in proportion to what the sections unpack to.
RadianceField DecodeField(const PageField& page);

// The splats of a page in its order: which they are in `geometry`, that of the field that was
// encoded or decoded, and from which others they are predicted.
struct PageRecords {
  std::vector<int64_t> splat;
  std::vector<EarlierRecords> earlier;
};
PageRecords RecordsInPageOrder(const PageField& page, const Geometry& geometry);

// About how much of each splat is seen, opacity times the area of the two longest axes: colours
// of which little is seen may be rounded more coarsely.
std::vector<float> LightOfSplats(const Geometry& geometry);

}  // namespace regrade
