// One camera for a capture whose photos differ in size, orientation or lens: the film's, and
// that of the frames on which neighbouring views are compared.
#pragma once

#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

// True if all have the same size, focal lengths, principal point and distortion.
bool HaveSameIntrinsics(const std::vector<Camera>& cameras);

// Intrinsics that represent all `cameras` (at least one, in the natural order of the photos'
// names); pose and device coordinates are the first camera's. No distortion, a centred
// principal point.
//
// If all intrinsics are the same, size and focal lengths are theirs. Otherwise:
// - size: that of one photo. Its orientation is that of most photos (a square counts as
//   landscape, and landscape wins a tie); among these its aspect is the median (the lower one
//   of two), and it is the first of that aspect.
// - focal length: the median over all photos of the focal length divided by the longer side,
//   times the longer side of that size. Photos with a common longer side give the median in
//   pixels.
// - pixels are square, unless the median of fy / fx over the photos of that orientation differs
//   from 1 by more than kSquarePixels, a bound above the effect of rounding sizes.
inline constexpr double kSquarePixels = 0.01;
Camera CommonCamera(const std::vector<Camera>& cameras);

// `cameras` themselves if their intrinsics are the same; otherwise CommonCamera with the pose
// of each.
std::vector<Camera> WithCommonIntrinsics(const std::vector<Camera>& cameras);

}  // namespace regrade
