// A capture: photos with cameras, sparse points, and the status of each given file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/geo_position.h"
#include "kernels/scene/image.h"
#include "kernels/scene/photo_status.h"

namespace regrade {

// A photo that was decoded and written beside the result as an upright RGB PNG, before poses
// are known.
struct StagedPhoto {
  std::string file;  // the user's name, relative to the given folder
  std::string name;  // ours: "00007.png", numbered in natural order of `file`
  std::string path;  // absolute path of the PNG
  int width = 0;     // pixels, after EXIF orientation
  int height = 0;
  double exif_focal_px = 0;             // focal length in pixels from EXIF; 0 where unknown
  int bits = 8;                         // of a value in the PNG: 8 or 16
  int clip = -1;                        // index of the film that it is a frame of; -1: a photo
  int orientation = 1;                  // of EXIF, 1..8: how the file's pixels were turned
  std::optional<GeoPosition> gps = {};  // of EXIF
};

// A registered photo. `name` is the staged name ("00007.png"); `file` the user's.
struct CaptureView {
  std::string name;
  std::string file;
  std::string path;   // of the image file, absolute
  Camera camera;      // at the photo's own size
  bool test = false;  // the poses name it as a test photo
};

// A triangulated point in the world frame of the cameras.
struct ScenePoint {
  Vec3d position;
  Vec3f color;                    // sRGB in [0, 1]
  double reprojection_error = 0;  // pixels
  std::vector<int32_t> views;     // indices into Capture::views, ascending, without repeats
};

// The extent of a scene in the world frame of the cameras.
struct WorldBox {
  Vec3d low, high;
};

// A volume, and within the range of scenes.
inline bool IsSound(const WorldBox& box) {
  constexpr double kFarthest = 1e12;
  for (int a = 0; a < 3; ++a)
    if (!(box.low[a] >= -kFarthest && box.low[a] < box.high[a] && box.high[a] <= kFarthest))
      return false;
  return true;
}

struct Capture {
  std::vector<CaptureView> views;  // in natural order of `file`
  std::vector<ScenePoint> points;  // empty for poses without points
  double nearest_depth = 0;        // of the scene, if given with the poses; else 0
  std::optional<WorldBox> box;     // of the scene, if given with the poses
  std::vector<PhotoStatus> statuses;
  double reprojection_px = 0;  // mean over observations, at the photos' size
  int models_found = 0;        // by COLMAP; 0 for poses from another source
  bool rendered = false;       // there are no photos: the pictures are renders of the scene
};

// Whether the poses name photos for tests, and others.
bool HasTestSplit(const Capture& capture);

// [views]: true for held-out views. These are the test photos where the poses name some. Else
// they are every `holdout`-th in order, starting with the first, where photos from one place
// (twins: two files of one shot, a burst) count as one and are held out together, so that none
// is fitted that shows what a held-out one does. A place that would leave less than half of the
// photos, or less than two, is passed over. holdout 0 keeps none, and of renders none is kept.
std::vector<bool> HeldOutViews(const Capture& capture, int holdout);

// CaptureView::file of each view.
std::vector<std::string> FilesOf(const Capture& capture);

// Memory of the largest photo while it is decoded and made smaller.
int64_t LargestPhotoBytes(const Capture& capture);

}  // namespace regrade
