#include "pipeline/page/check_page.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/image/decibels.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/camera_path.h"

namespace regrade {
namespace {

// Turned about its own axes, from where it stands moved to `center`.
Camera Placed(const Camera& camera, const Mat3d& turn, const Vec3d& center) {
  Camera placed = camera;
  placed.camera_from_world.rotation = turn * camera.camera_from_world.rotation;
  placed.camera_from_world.translation = -(placed.camera_from_world.rotation * center);
  return placed;
}

Mat3d Turn(const Vec3d& x, const Vec3d& y, const Vec3d& z) {
  Mat3d m;
  m.row[0] = x, m.row[1] = y, m.row[2] = z;
  return m;
}

}  // namespace

Camera SmallerView(const Camera& camera, int longest) {
  const double scale =
      std::min(1.0, static_cast<double>(longest) / std::max(camera.width, camera.height));
  return camera.Resized(std::max(1, static_cast<int>(camera.width * scale)),
                        std::max(1, static_cast<int>(camera.height * scale)));
}

std::vector<Camera> CheckedViews(const std::vector<Camera>& photos, int longest) {
  constexpr int kPhotos = 12, kPath = 8;
  std::vector<Camera> cameras;
  const int n = static_cast<int>(photos.size());
  for (int i = 0; i < std::min(kPhotos, n); ++i)
    cameras.push_back(photos[static_cast<size_t>(i * n / std::min(kPhotos, n))]);
  std::vector<double> moments;
  for (int i = 0; i < kPath; ++i) moments.push_back(i / (kPath - 1.0));
  for (const Camera& camera : MakeCameraPath(photos, PathOptions{}, moments))
    cameras.push_back(camera);

  const Camera& first = photos[0];
  Vec3d mean{};
  for (const Camera& camera : photos) mean += camera.Center() / static_cast<double>(n);
  const Vec3d here = first.Center();
  // Forward-facing captures have no image of what does not run forward.
  const Vec3d back = first.ndc.on() ? Vec3d{0.2, 0, 0.98} : Vec3d{0, 0, -1};
  const Vec3d right = Normalized(Cross(Vec3d{0, 1, 0}, back));
  cameras.push_back(Placed(first, {}, mean));
  cameras.push_back(Placed(first, Turn(right, Cross(back, right), back), here));
  cameras.push_back(Placed(first, {}, here + first.Forward() * (0.3 * Norm(mean - here))));
  cameras.push_back(Placed(first, Turn({0, 1, 0}, {-1, 0, 0}, {0, 0, 1}), here));
  for (Camera& camera : cameras) camera = SmallerView(camera, longest);
  return cameras;
}

PageCheck CheckPage(RadianceField exact, RadianceField page,
                    const std::vector<Camera>& cameras) {
  const FieldRenderer of_exact(std::move(exact), Backend::kCpu),
      of_page(std::move(page), Backend::kCpu);
  PageCheck check{1e9, 0, static_cast<int>(cameras.size())};
  for (const Camera& camera : cameras) {
    const double db =
        DecibelsBetween(of_exact.Render(camera).color, of_page.Render(camera).color);
    check.worst_db = std::min(check.worst_db, db);
    check.mean_db += db / check.views;
  }
  return check;
}

}  // namespace regrade
