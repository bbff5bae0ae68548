// Where the film's camera goes: a smooth flight past the photos' places, an orbit, or a spiral.
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
              "the film's way: smooth flies past the photos' places, views jumps from photo to "
              "photo, orbit circles what they look at, spiral sways before it",
          .choices = "smooth|views|orbit|spiral"});
    bind("path-frames", path_frames,
         {.unit = "frames", .help = "of the film; not for views", .min = 2, .max = 100000});
  }
};

// `cameras` in any order, in one frame, z up; at least one. The path's cameras are CommonCamera
// (kernels/scene/common_camera.h) elsewhere; for "views" WithCommonIntrinsics. "smooth" stays
// within the hull of neighbouring photos, where the field is supported by photos.
std::vector<Camera> MakeCameraPath(const std::vector<Camera>& cameras,
                                   const PathOptions& options);

// An order of the cameras without jumps: natural order, or a shorter tour by 2-opt where one is
// found.
std::vector<int> SmoothOrder(const std::vector<Camera>& cameras);

}  // namespace regrade
