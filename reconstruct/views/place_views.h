// Places views in a scene of splats whose cameras are not known.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

inline constexpr int kMostPlacedViews = 36;

struct PlacedViews {
  std::vector<Camera> cameras;  // pinholes of 4:3, `longest` pixels wide
  std::string summary;          // "an object seen from outside: 36 views on 3 rings around it"
};

// `renderer` draws `splats`, in whose world `up` is. An object is what stands alone: pictures
// that it fits into are empty along their edges, and it shows more from outside than from
// within. It is seen from three rings around it. Another scene is seen from places around and
// inside of its middle: of some hundreds of candidates, those that show much of it, filled and
// without holes, each adding to what the ones before show. Where a place shows holes it is left
// out. The same splats give the same views. Throws Error(kInput) with `where` if no place shows
// anything, Interrupted.
PlacedViews PlaceViews(const Splats& splats, const FieldRenderer& renderer, const Vec3d& up,
                       int longest, const std::string& where, const ProgressFunction& progress);

}  // namespace regrade
