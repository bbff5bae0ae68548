// A plan of the capture: where each photo was taken from and which way it looks, seen from
// above.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

struct CameraMap {
  struct Mark {
    double x = 0, y = 0;  // of the plan, its own unit
    double look_x = 0,
           look_y = 0;        // of a unit vector along the optical axis, as seen from above
    double half_width = 0.5;  // tangent of half the angle of view
    bool held_out = false;
    std::string file;  // the user's name
  };
  std::vector<Mark> cameras;
  std::vector<std::pair<double, double>> points;  // of the scene, some of them
};

// "Above" is the mean of what the cameras call up, and up the page is where they look on the
// whole; where cameras are turned every way, the first one's up.
CameraMap MapCameras(const Capture& capture, int holdout);

// A <figure> with the plan; "" without cameras. File names may be hostile.
std::string CameraMapHtml(const CameraMap& map);

}  // namespace regrade
