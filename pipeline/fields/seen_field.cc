#include "pipeline/fields/seen_field.h"

#include "kernels/splats/cpu/seen_by_cameras.h"
#include "kernels/splats/splat_field.h"

namespace regrade {

StoredField ReadSeenField(const std::string& path, const std::vector<Camera>& cameras) {
  return ReadPartOfField(path, [&](const RadianceField& field) {
    std::vector<uint8_t> seen;
    MarkSeenSplats(SplatsWithoutColors(field.geometry->splats), cameras, SplatOptionsOf(field),
                   &seen);
    return seen;
  });
}

}  // namespace regrade
