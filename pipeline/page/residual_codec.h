// Packs what a style adds splat by splat behind its network, for a page: a residual of colours
// with its scale of what changes with the view (see EQ(view-scale)), and the weights of masked
// objects.
//
// Each is of 8 bits: colours (code - 128) times a scale of each channel, the others code / 255.
// A section has the numbers code - 128 of colours, 255 - code of view scales and code of
// weights, packed as EQ(page-prediction) says: where nothing is added they are 0 and cost next
// to nothing.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/value_codec.h"
#include "stylize/field/voxel_residual.h"

namespace regrade {

// Of splats in any one order; empty where there is none.
struct StyleLayers {
  VoxelResidual residual;
  std::vector<float> weight;

  bool empty() const { return residual.color.empty() && weight.empty(); }
};

struct PageResidual {
  // "scale" [3]: of colours, in coefficients of the constant harmonic; or null. "view": whether
  // there are view scales, "weight": whether there are weights.
  JsonValue header;
  std::string packed;   // compressed
  StyleLayers rounded;  // as the page has them
};

// `layers` in the order of the splats, whose earlier ones are `earlier`.
PageResidual EncodeResidual(const StyleLayers& layers,
                            const std::vector<EarlierRecords>& earlier);

// Adds them to the styled coefficients; layer i is that of splats[i]. Coefficients and
// background colours are the source's where the weights are 0; see EQ(style-mix).
void ApplyLayers(const StyleLayers& layers, const std::vector<int64_t>& splats,
                 const RadianceField& source, RadianceField* styled);

}  // namespace regrade
