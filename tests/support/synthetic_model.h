// A COLMAP model with exact geometry: cameras on an arc around a cloud of points.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

#include "kernels/base/random.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade::testing {

struct SyntheticModelOptions {
  int images = 8;
  int points = 60;
  double arc_deg = 40;   // between the first camera and the last
  double thickness = 1;  // of the cloud along the line of sight; its width is 2
  double aspect = 1;     // fx / fy
  double focal = 600;    // fy, pixels
  ColmapLens lens = ColmapLens::kSimpleRadial;
};

inline std::string StagedName(int index) {
  char name[32];
  std::snprintf(name, sizeof(name), "%05d.png", index);
  return name;
}

// Image i has the id i + 1 and the name "0000i.png"; pictures are 640 x 480.
inline ColmapModel MakeSyntheticModel(const SyntheticModelOptions& options = {}) {
  ColmapModel model;
  ColmapCamera camera{1, options.lens, {}};
  Camera& c = camera.intrinsics;
  c.width = 640, c.height = 480;
  c.fx = options.focal * options.aspect, c.fy = options.focal;
  c.cx = 320, c.cy = 240;
  if (options.lens != ColmapLens::kSimplePinhole && options.lens != ColmapLens::kPinhole)
    c.lens = LensModel::kOpenCv;
  model.cameras.push_back(camera);

  for (int i = 0; i < options.images; ++i) {
    ColmapImage image;
    image.id = static_cast<uint32_t>(i + 1);
    image.camera_id = 1;
    image.name = StagedName(i);
    const double position = options.images > 1 ? i / (options.images - 1.0) - 0.5 : 0;
    const double angle = position * options.arc_deg * M_PI / 180;
    const double s = std::sin(angle), k = std::cos(angle);
    image.camera_from_world = {{{{k, 0, -s}, {0, 1, 0}, {s, 0, k}}}, {0, 0, 6}};
    model.images.push_back(image);
  }
  for (int j = 0; j < options.points; ++j) {
    const auto random = [&](int axis) { return 2 * RandomDouble(7, axis, j) - 1; };
    ColmapPoint point;
    point.id = static_cast<uint64_t>(j + 1);
    point.position = {random(0), random(1), options.thickness * random(2)};
    point.color = {static_cast<uint8_t>(j), 128, 255};
    for (ColmapImage& image : model.images) {
      ColmapKeypoint keypoint;
      keypoint.point_id = point.id;
      model.CameraOf(image).Project(point.position, &keypoint.u, &keypoint.v);
      point.track.push_back({image.id, static_cast<uint32_t>(image.keypoints.size())});
      image.keypoints.push_back(keypoint);
    }
    model.points.push_back(point);
  }
  return model;
}

// The photos of the model, and `more` that are not in it.
inline std::vector<StagedPhoto> PhotosOf(const ColmapModel& model, int more = 0) {
  std::vector<StagedPhoto> photos;
  const int known = static_cast<int>(model.images.size());
  for (int i = 0; i < known + more; ++i)
    photos.push_back({"IMG " + std::to_string(i) + ".jpg", StagedName(i),
                      "/photos/" + StagedName(i), 640, 480, 0});
  return photos;
}

}  // namespace regrade::testing
