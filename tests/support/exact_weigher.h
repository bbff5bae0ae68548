// A weigher of a field that drops nothing.
#pragma once

#include <memory>

#include "kernels/render/ray_weigher.h"

namespace regrade {

// The field must outlive it.
inline std::unique_ptr<RayWeigher> ExactWeigher(const RadianceField& field) {
  return MakeRayWeigher(*field.geometry, field.near_clip, field.march);
}

}  // namespace regrade
