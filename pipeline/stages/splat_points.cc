#include "pipeline/stages/splat_points.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/splats/splat_color.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/stages/splat_views.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/views/scene_extent.h"

namespace regrade {
namespace {

constexpr int64_t kMostPoints = 8000;
constexpr int kSide = 160;           // pixels of the longer side of the depths
constexpr double kSameDepth = 0.05;  // relative: a splat at the depth that a view shows

bool Shows(const Camera& small, const Image& depths, const Vec3d& point) {
  double u = 0, v = 0, depth = 0;
  if (!small.Project(point, &u, &v, &depth)) return false;
  if (!(u >= 0 && v >= 0 && u < small.width && v < small.height)) return false;
  const float shown = *depths.at(static_cast<int>(u), static_cast<int>(v));
  return shown > 0 && std::abs(depth - shown) <= kSameDepth * shown;
}

}  // namespace

void AddSplatPoints(const RadianceField& field, const FieldRenderer& renderer,
                    const std::string& sparse_folder, const std::string& cameras,
                    Capture* capture) {
  const SplatsView<float> splats = SplatsOf(field);
  ColmapModel model = ReadColmapModel(sparse_folder);
  std::map<std::string, ColmapImage*> image_of;
  for (ColmapImage& image : model.images) image_of[image.name] = &image;
  const std::vector<int64_t> some = OpaqueSplats(splats, kMostPoints);
  std::vector<ScenePoint> points(some.size());
  for (size_t k = 0; k < some.size(); ++k) {
    points[k].position = splats[some[k]].mean.Cast<double>();
    const float* const sh = splats.Coefficients(some[k]);
    for (int c = 0; c < 3; ++c)
      points[k].color[c] =
          std::clamp(0.5f + static_cast<float>(kSh0) * sh[c * splats.basis], 0.0f, 1.0f);
  }
  for (size_t v = 0; v < capture->views.size(); ++v) {
    const Camera small = ReducedTo(kSide, capture->views[v].camera.Undistorted());
    const Image depths = renderer.Render(small).depth;
    for (ScenePoint& point : points)
      if (Shows(small, depths, point.position)) point.views.push_back(static_cast<int32_t>(v));
  }
  std::erase_if(points, [](const ScenePoint& point) { return point.views.size() < 2; });
  if (points.size() < kFewestSplatPoints)
    throw InputError("the cameras see next to nothing of the splats", cameras,
                     "give the cameras that the splats were fitted with, in the same world; or "
                     "leave --cameras out");
  model.points.clear();
  for (ColmapImage& image : model.images) image.keypoints.clear();
  for (const ScenePoint& point : points) {
    ColmapPoint added;
    added.id = model.points.size() + 1;
    added.position = point.position;
    added.error = 0;
    for (size_t c = 0; c < 3; ++c)
      added.color[c] =
          static_cast<uint8_t>(std::lround(255 * point.color[static_cast<int>(c)]));
    for (const int32_t v : point.views) {
      const CaptureView& view = capture->views[static_cast<size_t>(v)];
      const auto found = image_of.find(view.name);
      double x = 0, y = 0;
      if (found == image_of.end() || !view.camera.Project(point.position, &x, &y)) continue;
      ColmapImage& image = *found->second;
      added.track.push_back({image.id, static_cast<uint32_t>(image.keypoints.size())});
      image.keypoints.push_back({x, y, added.id});
    }
    model.points.push_back(std::move(added));
  }
  WriteColmapModel(model, sparse_folder);
  capture->points = std::move(points);
  capture->reprojection_px = 0;
}

}  // namespace regrade
