// Points that photos saw: evidence of depth for the fit.
#pragma once

#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/capture.h"

namespace regrade {

// A triangulated point as one photo saw it.
struct SeenPoint {
  Vec3f position;   // in the field's frame (not in device coordinates)
  float sigma = 0;  // standard deviation of its distance to the camera, in the field's unit
};

// What each of `views` saw of the points that at least two of them saw; in order of views and
// of the capture's points. `pixel_error` is the error of an observation in pixels of the photo.
// A point whose distance is less certain than half of it is left out.
std::vector<std::vector<SeenPoint>> PointsSeenBy(const Capture& capture,
                                                 const std::vector<int>& views,
                                                 const Similarity& field_from_world,
                                                 double pixel_error = 1);

}  // namespace regrade
