// Camera path of the film: a smooth flight past the photos' positions, an orbit, or a spiral.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct PathOptions {
  std::string path = "smooth";
  int path_frames = 96;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("path", path,
         {.help =
              "camera path of the film: smooth flies past the photos' positions, views shows "
              "them one by one, orbit circles the point they look at, spiral moves in front of "
              "it",
          .choices = "smooth|views|orbit|spiral"});
    bind("path-frames", path_frames,
         {.unit = "frames",
          .help = "length of the film; not for views",
          .min = 2,
          .max = 100000});
  }
};

// `cameras` in any order, in one frame, z up; at least one. All cameras of the path have the
// intrinsics of CommonCamera (kernels/scene/common_camera.h), those of "views" of
// WithCommonIntrinsics. "smooth" stays within the hull of neighbouring photos, where photos
// support the field.
std::vector<Camera> MakeCameraPath(const std::vector<Camera>& cameras,
                                   const PathOptions& options);

// An order of the cameras without jumps: the natural order, or a shorter tour found by 2-opt.
std::vector<int> SmoothOrder(const std::vector<Camera>& cameras);

}  // namespace regrade
