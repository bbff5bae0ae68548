#include "pipeline/fields/seen_field.h"

#include "kernels/splats/cpu/seen_by_cameras.h"
#include "kernels/splats/splat_field.h"

namespace regrade {

StoredField SeenPart(StoredField geometry, const std::string& path,
                     const std::vector<Camera>& cameras) {
  if (geometry.field.geometry != nullptr && !geometry.field.geometry->splats.on())
    return geometry;
  geometry = {};
  return ReadPartOfField(path, [&](const RadianceField& field) {
    return SeenSplats(SplatsWithoutColors(field.geometry->splats), cameras,
                      SplatOptionsOf(field));
  });
}

}  // namespace regrade
