// Splats in another frame.
#pragma once

#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

// Takes splats to another frame.
class SplatMove {
 public:
  explicit SplatMove(const Similarity& target_from_source);
  void Apply(int basis, ColoredSplat* record) const;

 private:
  Similarity move_;
  double log_scale_;
  SplatTurn turn_;
};

// From the frame of `stored` to the world of the capture's cameras.
SplatMove ToWorld(const StoredField& stored);

// The same scene in another frame.
void MoveSplats(const Similarity& target_from_source, Splats* splats);

// The splats of `stored`, which has some, in the world of the capture's cameras.
Splats WorldSplats(const StoredField& stored);

// From right, down and front, the axes of cameras and of a PLY, to right, up and back, those of
// SPZ and glTF: a half turn about x, which is its own inverse. It changes signs only.
Mat3d HalfTurnAboutX();

}  // namespace regrade
