// A capture in one file, for a machine that has a GPU and nothing else: decoded photos at
// working size, cameras in the field's frame, the box, and which views are kept for measuring.
//
// The file is a deflated .npz. Pixels are 8 bits a channel, each row stored as differences
// (modulo 256) to the pixel on the left, which deflates to two thirds; photos that were scaled
// down lose what lies below a level.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

struct PackedView {
  std::string file;  // as the user named it
  bool held_out = false;
  Camera camera;  // in the field's frame, at the photo's size
  Image photo;    // [H, W, 3] sRGB
};

struct PackedCapture {
  NormalizedScene scene;
  std::vector<PackedView> views;
  Image style;  // [H, W, 3] sRGB, or empty: the picture whose colours the scene shall have
};

// Throws Error(kResources).
void WritePackedCapture(const std::string& path, const PackedCapture& capture);
// Throws Error(kInput) naming file and array for anything that is not whole and sound.
PackedCapture ReadPackedCapture(const std::string& path);

}  // namespace regrade
