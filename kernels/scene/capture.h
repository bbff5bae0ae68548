// A capture: photos with cameras, sparse points, and the status of each input file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct PhotoStatus {
  std::string file;    // as given by the user, relative to the input folder
  std::string status;  // "used" | "skipped" | "unregistered"
  std::string why;     // reason or remark; may be empty for "used"
};

// A photo that was decoded and written to the workspace as a plain 8-bit upright PNG, before
// poses are known.
struct StagedPhoto {
  std::string file;  // as given by the user, relative to the input folder
  std::string name;  // staged name: "00007.png", numbered in natural order of `file`
  std::string path;  // absolute path of the PNG
  int width = 0;     // pixels, after EXIF orientation
  int height = 0;
  double exif_focal_px = 0;  // focal length in pixels from EXIF; 0 where unknown
};

// A registered photo. `name` is the staged name ("00007.png"); `file` the user's.
struct CaptureView {
  std::string name;
  std::string file;
  std::string path;  // of the image file, absolute
  Camera camera;     // at the photo's own size
};

// A triangulated point in the world frame of the cameras.
struct ScenePoint {
  Vec3d position;
  Vec3f color;                    // sRGB in [0, 1]
  double reprojection_error = 0;  // pixels
  std::vector<int32_t> views;     // indices into Capture::views, ascending, without repeats
};

struct Capture {
  std::vector<CaptureView> views;  // in natural order of `file`
  std::vector<ScenePoint> points;  // empty for poses without points
  double nearest_depth = 0;        // of the scene, if given with the poses; else 0
  std::vector<PhotoStatus> statuses;
  double reprojection_px = 0;  // mean over observations, at the photos' size
  int models_found = 0;        // by COLMAP; 0 for poses from another source
};

// True for held-out views: every `holdout`-th in order, starting with the first; holdout 0
// keeps none.
inline bool IsHeldOut(size_t view_index, int holdout) {
  return holdout > 0 && view_index % static_cast<size_t>(holdout) == 0;
}

}  // namespace regrade
