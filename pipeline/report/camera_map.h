// A map of the capture from above: positions and viewing directions of the cameras.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

struct CameraMap {
  struct Mark {
    double x = 0, y = 0;  // on the map, in units of the world
    double look_x = 0,
           look_y = 0;        // the unit vector along the optical axis, projected
    double half_width = 0.5;  // tangent of half the angle of view
    bool held_out = false;
    std::string file;  // the user's name
  };
  std::vector<Mark> cameras;
  std::vector<std::pair<double, double>> points;  // of the scene, a selection
};

// "Above" is the mean up vector of the cameras, and the top of the page is their mean viewing
// direction; where these cancel, the first camera's up vector and any direction across it.
CameraMap MapCameras(const Capture& capture, int holdout);

// A <figure> with the map; "" without cameras. File names may be hostile.
std::string CameraMapHtml(const CameraMap& map);

}  // namespace regrade
