// The order in which a page stores the texels of background spheres: column by column, each
// from the innermost layer outwards.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "pipeline/page/page_order.h"

namespace regrade {

struct SphereOrder {
  std::vector<int32_t> place;           // [columns]: x R + y in the map
  std::vector<EarlierRecords> earlier;  // [columns * layers]: texels inwards, north and west
};

// Columns that a ray can see: with a positive density, or beside such a column.
std::string MaskOfSpheres(const SphereGeometry& spheres);
// Throws Error(kInput) for bytes of another size.
SphereOrder OrderOfSpheres(std::string_view mask, int resolution, int layers);

}  // namespace regrade
