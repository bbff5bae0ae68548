// Places views in a scene of splats whose cameras are not known.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

inline constexpr int kMostPlacedViews = 36;

struct PlacedViews {
  std::vector<Camera> cameras;  // pinholes of 4:3, or 3:4 for upright objects
  std::string summary;          // "an object, seen from outside: 36 views ..."
};

// `field` is made of `splats`, in whose world `up` is. If two rings around them, from which
// they fit into the picture, show clearly more of them well than the best views that they fill,
// they are an object, and the rings are its views, without those that show holes. Else views
// are chosen from some hundreds of candidates around and within the middle of the scene, and
// beside the best of these: those that show much of it, filled and without holes, each adding
// to what the ones before show. Of more than 200,000 splats some stand for all, enlarged. The
// same splats give the same views. Throws Error(kInput) with `where` if no place shows
// anything, Interrupted.
PlacedViews PlaceViews(const Splats& splats, const RadianceField& field, Backend backend,
                       const Vec3d& up, int longest, const std::string& where,
                       const ProgressFunction& progress);

}  // namespace regrade
