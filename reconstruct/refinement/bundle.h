// The data of a bundle adjustment: which photo saw which point where, in a world of the
// cameras' own size, and the way there and back from a COLMAP model.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// With fewer observations a pose is left as it is.
inline constexpr size_t kFewestObservations = 15;

struct BundleObservation {
  size_t view, point;
  double u, v;    // pixels
  bool held_out;  // to judge by
};

struct Bundle {
  std::vector<Camera> lenses;                // of each view; poses are not used
  std::vector<size_t> camera;                // of each view, an index into ColmapModel::cameras
  std::vector<Mat3d> rotations;              // camera from world, as they came
  std::vector<std::array<double, 6>> poses;  // of each view: a further rotation vector, centre
  std::vector<std::array<double, 3>> points;
  std::vector<double> focal;                    // of each camera: log of a factor
  std::vector<BundleObservation> observations;  // those of a point side by side
  std::vector<bool> adjustable;                 // views with kFewestObservations
  Similarity bundle_from_world;                 //
  double spread = 0;                            // largest distance between cameras, here
};

// Observations behind their camera are left out, and so are points that fewer than two photos
// see. Of points that four see at least, a tenth of the observations are held out, drawn by the
// names of photos and the number of the point. `spread` 0: all cameras stand at one place.
Bundle MakeBundle(const ColmapModel& model);

// Pixels; infinite behind the camera.
double ReprojectionError(const Bundle& bundle, const BundleObservation& observation);

// Median over the observations that are held out, or those that are not; 0 of none.
double MedianError(const Bundle& bundle, bool held_out);

// The model with the bundle's poses, points and focal lengths, moved by the similarity that
// brings the cameras nearest to where `model` has them. Points that are not in the bundle keep
// their places.
ColmapModel ModelOfBundle(const Bundle& bundle, const ColmapModel& model);

}  // namespace regrade
