// Camera path of the film: a smooth flight past the photos' positions, an orbit, or a spiral.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct PathOptions {
  std::string path = "smooth";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("path", path,
         {.help =
              "camera path of the film: smooth flies past the photos' positions, views shows "
              "them one by one, orbit circles the point they look at, spiral moves in front of "
              "it",
          .choices = "smooth|views|orbit|spiral"});
  }
};

// `cameras` in any order, in one frame, z up; at least one. All cameras of the path have the
// intrinsics of CommonCamera (kernels/scene/common_camera.h), those of "views" of
// WithCommonIntrinsics, one for each of `cameras`; of the others one for each of `moments`,
// parts of the film's time in [0, 1]. "smooth" stays within the hull of neighbouring photos,
// where photos support the field: each place is a mean of photos along their tour, with a
// Gaussian of `width` times 1.5 of their distance. It begins and ends at rest; "orbit" and
// "spiral" are closed.
std::vector<Camera> MakeCameraPath(const std::vector<Camera>& cameras,
                                   const PathOptions& options,
                                   const std::vector<double>& moments, double width = 1);

// Part of the way at part `time` of the time, both in [0, 1]: speed rises from 0 within the
// first kEasing of the time, is constant, and falls to 0 within the last.
inline constexpr double kEasing = 0.15;
double EasedWay(double time);

// An order of the cameras without jumps: the natural order, or a shorter tour found by 2-opt.
std::vector<int> SmoothOrder(const std::vector<Camera>& cameras);

}  // namespace regrade
