// A small field that looks like a large one from afar: what a page shows first.
//
// A uniform grid of wider voxels over the same box, of one colour each. A voxel has the mean
// density of what lies in it, so that a ray that crosses it loses about as much light, and the
// mean colour, by density: most of what it shows is then a little wider and softer.
#pragma once

#include <cstdint>
#include <optional>

#include "kernels/field/radiance_field.h"

namespace regrade {

struct CoarseOptions {
  int64_t most_voxels = 120000;
  int longest = 192;            // voxels along the longest edge, at most
  double most_part = 1.0 / 16;  // of the field's voxels; small fields have no coarse one
};

std::optional<RadianceField> CoarseField(const RadianceField& field,
                                         const CoarseOptions& options = {});

}  // namespace regrade
