#include "reconstruct/scene/scene_box.h"

#include <algorithm>
#include <cmath>

namespace regrade {

Vec3i ResolutionFor(const SceneBox& box, int longest) {
  const Vec3f side{box.radius.x, box.radius.y / box.voxel_aspect, box.radius.z};
  const float most = std::max({side.x, side.y, box.layers > 0 ? 0.0f : side.z});
  Vec3i n;
  for (int a = 0; a < 3; ++a)
    n[a] = std::max(
        2, static_cast<int>(std::lround(static_cast<float>(longest) * side[a] / most)));
  if (box.layers > 0) n.z = std::min(box.layers, longest);
  return n;
}

}  // namespace regrade
