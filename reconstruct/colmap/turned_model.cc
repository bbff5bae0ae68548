#include "reconstruct/colmap/turned_model.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

namespace regrade {
namespace {

// The upright camera's x and y axes in the stored one's: (x, y) becomes (a x + b y, c x + d y).
struct Turn {
  double a, b, c, d;
};

Turn TurnOf(int orientation) {
  switch (orientation) {
    case 3:
      return {-1, 0, 0, -1};
    case 6:
      return {0, -1, 1, 0};
    case 8:
      return {0, 1, -1, 0};
    default:
      return {1, 0, 0, 1};
  }
}

Camera Turned(const Camera& stored, int orientation) {
  const Turn turn = TurnOf(orientation);
  Camera camera = stored;
  TurnPoint(orientation, stored.width, stored.height, &camera.cx, &camera.cy);
  if (turn.a == 0) {
    std::swap(camera.width, camera.height);
    std::swap(camera.fx, camera.fy);
  }
  // p1 and p2 are the components of a shift along y and x.
  if (camera.lens == LensModel::kOpenCv || camera.lens == LensModel::kFullOpenCv) {
    const double x = stored.distortion[3], y = stored.distortion[2];
    camera.distortion[3] = turn.a * x + turn.b * y;
    camera.distortion[2] = turn.c * x + turn.d * y;
  }
  return camera;
}

RigidTransform Turned(const RigidTransform& stored, int orientation) {
  const Turn turn = TurnOf(orientation);
  Mat3d about_axis;
  about_axis.row[0] = {turn.a, turn.b, 0};
  about_axis.row[1] = {turn.c, turn.d, 0};
  about_axis.row[2] = {0, 0, 1};
  return RigidTransform{about_axis, {}} * stored;
}

}  // namespace

void TurnPoint(int orientation, double width, double height, double* u, double* v) {
  const double x = *u, y = *v;
  const std::pair<double, double> upright[] = {
      {x, y}, {width - x, y},  {width - x, height - y}, {x, height - y},
      {y, x}, {height - y, x}, {height - y, width - x}, {y, width - x}};
  std::tie(*u, *v) = upright[std::clamp(orientation, 1, 8) - 1];
}

void TurnUpright(const std::map<std::string, int>& orientations, ColmapModel* model) {
  uint32_t next = 1;
  for (const ColmapCamera& camera : model->cameras) next = std::max(next, camera.id + 1);
  std::map<std::pair<uint32_t, int>, uint32_t> turned;
  for (ColmapImage& image : model->images) {
    const auto found = orientations.find(image.name);
    if (found == orientations.end()) continue;
    const int orientation = found->second;
    const ColmapCamera camera = *model->FindCamera(image.camera_id);
    const auto [entry, is_new] = turned.try_emplace({camera.id, orientation}, next);
    if (is_new)
      model->cameras.push_back({next++, camera.lens, Turned(camera.intrinsics, orientation)});
    image.camera_id = entry->second;
    image.camera_from_world = Turned(image.camera_from_world, orientation);
    for (ColmapKeypoint& keypoint : image.keypoints)
      TurnPoint(orientation, camera.intrinsics.width, camera.intrinsics.height, &keypoint.u,
                &keypoint.v);
  }
  std::set<uint32_t> in_use;
  for (const ColmapImage& image : model->images) in_use.insert(image.camera_id);
  std::erase_if(model->cameras,
                [&](const ColmapCamera& camera) { return in_use.count(camera.id) == 0; });
}

}  // namespace regrade
