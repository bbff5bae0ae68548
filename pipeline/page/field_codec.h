// Packs a radiance field of any kind for a page, and unpacks it as the page does.
//
// A page's field is a header, a JSON object, and sections of bytes, each compressed by itself
// (see deflate.h): what they hold is in voxel_codec.h and splat_codec.h. Whatever depends on
// the kind of a field is decided here.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
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

// A small field that stands for the whole one until that is unpacked, see coarse_field.h. None
// where the page has no need of one: splats begin with those that contribute most.
std::optional<PageField> EncodeCoarse(const RadianceField& field, double step);

// The records of a page in its order: which they are in `geometry`, that of the field that was
// encoded or decoded, and from which others they are predicted.
struct PageRecords {
  std::vector<int64_t> voxel;
  std::vector<EarlierRecords> earlier;
};
PageRecords RecordsInPageOrder(const PageField& page, const Geometry& geometry);

// "voxels" or "splats".
const char* RecordsName(const PageField& page);

// About how much of each record is seen, in any unit: colours of which little is seen may be
// rounded more coarsely.
std::vector<float> ColorWeights(const Geometry& geometry);

}  // namespace regrade
