// Packs a style for a page: its network, which the page sends the splats through.
//
// The network's effective weights, [out, in] and biases, layer after layer, are stored as
// halves: 20,379 of them. The code of the styled coefficients (see EQ(page-color-code)) is
// found when the page is written, on the field as the page has it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/residual_codec.h"

namespace regrade {

struct PageStyle {
  JsonValue header;
  std::string packed;    // the weights, compressed
  std::string residual;  // what is added splat by splat, see residual_codec.h; may be empty
  RadianceField styled;  // as the page will have it, up to the arithmetic of its processor
};

// `page`: of DecodeField. `strength` in [0, 1]: the weight at which the style is shown first.
PageStyle EncodeStyle(const StoredNetwork& stored, const RadianceField& page, double strength);
// With what the style adds splat by splat; `places`: the page's splats in `page`.
PageStyle EncodeStyle(const StoredNetwork& stored, const RadianceField& page, double strength,
                      const StyleLayers& layers, const PageRecords& places);

// The styled coefficients as a page that has run the network holds them: four words of 32 bits,
// the lowest byte first, for each of `splats`, see RecordsInPageOrder.
std::string StyledWords(const PageStyle& style, const std::vector<int64_t>& splats);

}  // namespace regrade
