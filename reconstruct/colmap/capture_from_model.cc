// Converts a COLMAP model to a Capture: matches names, compares sizes, and computes
// reprojection errors, because those stored in the file are stale after colmap's
// bundle_adjuster.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {
namespace {

std::string SizeText(int width, int height) { return Concat(width, " x ", height); }

CaptureView ViewOf(const ColmapModel& model, const ColmapImage& image,
                   const StagedPhoto& photo) {
  const Camera camera = model.CameraOf(image);
  if (camera.width != photo.width || camera.height != photo.height)
    throw InputError(
        "the photo has " + SizeText(photo.width, photo.height) +
            " pixels, its camera in the model " + SizeText(camera.width, camera.height),
        photo.file,
        "the poses belong to pictures of another size or orientation (COLMAP ignores "
        "EXIF orientation); use those pictures, or compute poses for the photos");
  return {photo.name, photo.file, photo.path, camera};
}

}  // namespace

Capture CaptureFromModel(const ColmapModel& model, const std::vector<StagedPhoto>& photos,
                         PhotoNames names) {
  std::unordered_map<std::string, const ColmapImage*> image_of_name;
  for (const ColmapImage& image : model.images) image_of_name[image.name] = &image;

  Capture capture;
  std::unordered_map<uint32_t, int32_t> view_of_image;
  for (const StagedPhoto& photo : photos) {
    const auto it = image_of_name.find(names == PhotoNames::kStaged ? photo.name : photo.file);
    if (it == image_of_name.end()) {
      capture.statuses.push_back(
          {photo.file, PhotoState::kUnregistered, "the model has no pose for it"});
      continue;
    }
    view_of_image[it->second->id] = static_cast<int32_t>(capture.views.size());
    capture.views.push_back(ViewOf(model, *it->second, photo));
    capture.statuses.push_back({photo.file, PhotoState::kUsed, ""});
  }
  if (capture.views.empty())
    throw InputError("no image name of the model is the name of a photo", "",
                     model.images.empty()
                         ? "the model has no images"
                         : "the model's first image is \"" + model.images.front().name + "\"");
  for (const ColmapImage& image : model.images)
    if (view_of_image.count(image.id) == 0)
      capture.statuses.push_back(
          {image.name, PhotoState::kSkipped, "in the model, but there is no such photo"});

  double error_sum = 0;
  int64_t observations = 0;
  for (const ColmapPoint& source : model.points) {
    ScenePoint point;
    point.position = source.position;
    for (int i = 0; i < 3; ++i) point.color[i] = source.color[i] / 255.0f;
    double point_sum = 0;
    int64_t point_observations = 0;
    for (const ColmapTrackElement& element : source.track) {
      const auto it = view_of_image.find(element.image_id);
      if (it == view_of_image.end()) continue;
      point.views.push_back(it->second);
      const ColmapKeypoint& keypoint =
          model.FindImage(element.image_id)->keypoints[element.keypoint];
      double u, v;
      if (!capture.views[it->second].camera.Project(source.position, &u, &v)) continue;
      point_sum += std::hypot(u - keypoint.u, v - keypoint.v);
      ++point_observations;
    }
    std::ranges::sort(point.views);
    point.views.erase(std::unique(point.views.begin(), point.views.end()), point.views.end());
    if (point.views.size() < 2) continue;
    if (point_observations > 0) point.reprojection_error = point_sum / point_observations;
    error_sum += point_sum;
    observations += point_observations;
    capture.points.push_back(std::move(point));
  }
  if (observations > 0) capture.reprojection_px = error_sum / static_cast<double>(observations);
  return capture;
}

}  // namespace regrade
