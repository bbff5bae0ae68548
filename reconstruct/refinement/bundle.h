// The data of a bundle adjustment, in a world scaled to the extent of the cameras, and its
// conversion from and to a COLMAP model.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// A pose with fewer observations is not adjusted.
inline constexpr size_t kFewestObservations = 15;

struct BundleObservation {
  size_t view, point;
  double u, v;    // pixels
  bool held_out;  // for validation
};

struct Bundle {
  std::vector<Camera> lenses;                // of each view; their poses are not used
  std::vector<size_t> camera;                // of each view, an index into ColmapModel::cameras
  std::vector<Mat3d> rotations;              // camera_from_world, initial
  std::vector<std::array<double, 6>> poses;  // of each view: angle-axis correction, centre
  std::vector<std::array<double, 3>> points;
  std::vector<double> focal;  // of each camera: log of a factor of its focal length
  std::vector<BundleObservation> observations;  // grouped by point
  std::vector<bool> adjustable;                 // views with at least kFewestObservations
  Similarity bundle_from_world;
  double extent = 0;  // largest distance between cameras, in the bundle's world: 1, or 0
};

// Omits observations behind their camera and points seen by fewer than two photos. Of points
// seen by at least four, a tenth of the observations is held out, drawn by the photos' names
// and the point's id. `extent` is 0 if all cameras are at one place.
Bundle MakeBundle(const ColmapModel& model);

// In pixels; infinite behind the camera.
double ReprojectionError(const Bundle& bundle, const BundleObservation& observation);

// Median in pixels over the observations that are held out, or over the others; 0 if there are
// none.
double MedianError(const Bundle& bundle, bool held_out);

// `model` with the bundle's poses, points and focal lengths, moved by the similarity that best
// aligns the cameras with those of `model`. Points that are not in the bundle are not moved.
ColmapModel ModelOfBundle(const Bundle& bundle, const ColmapModel& model);

}  // namespace regrade
