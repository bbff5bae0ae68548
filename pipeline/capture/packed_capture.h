// A capture in one file for bare GPU machines: decoded photos at working size, cameras in the
// field's frame, the box, and which views are held out.
//
// The file is a deflated .npz. Pixels have 8 bits a channel, each row stored as differences
// (modulo 256) to the pixel on the left, which deflates to two thirds. Photos that were scaled
// down or have more than 8 bits are rounded.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/normalize_scene.h"
#include "reconstruct/scene/point_observations.h"

namespace regrade {

struct PackedView {
  std::string file;  // the user's name
  bool held_out = false;
  Camera camera;                  // in the field's frame, at the photo's size
  Image photo;                    // [H, W, 3] sRGB
  std::vector<SeenPoint> points;  // of a fitted view; may be empty
};

struct PackedCapture {
  NormalizedScene scene;
  std::vector<PackedView> views;
  Image style;  // [H, W, 3] sRGB, or empty: the style picture
  // JSON of the options that decided the scene; empty in older files.
  std::string decided;
};

// Throws Error(kResources).
void WritePackedCapture(const std::string& path, const PackedCapture& capture);
// Throws Error(kInput) naming file and array for a damaged file.
PackedCapture ReadPackedCapture(const std::string& path);

}  // namespace regrade
