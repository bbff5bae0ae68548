// Cameras of a capture whose photos are not there, for scenes that are rendered in their place,
// and for programs that show a scene from them.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

struct BareCamera {
  std::string name;  // of the photo that it took
  Camera camera;     // a pinhole, in the capture's world
};

// Of a cameras.json as Kerbl et al.'s program writes it (a list with img_name, width, height,
// position, rotation, fx and fy), a folder with one or with a COLMAP model but without the
// pictures, or an output folder of regrade without photos. Empty where `path` is none of these,
// or has its photos. Throws Error(kInput) for a file that is damaged.
std::vector<BareCamera> ReadBareCameras(const std::string& path);

// The cameras of cameras.json: `rotation` is world from camera, `position` the camera's centre,
// its axes are right, down and front. Throws Error(kInput) with the place in the file.
std::vector<BareCamera> ReadCamerasJson(const std::string& path);

// Writes such a file. It has no place for principal points, and they are read as the middle of
// the picture. Throws Error(kResources).
void WriteCamerasJson(const std::string& path, const std::vector<BareCamera>& cameras);

}  // namespace regrade
