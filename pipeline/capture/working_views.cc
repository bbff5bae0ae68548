#include "pipeline/capture/working_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/photo_masks.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

// Rounded per side; the camera's focal lengths follow each side's own ratio.
void WorkingSize(int width, int height, int longest_side, int* new_width, int* new_height) {
  const double scale =
      std::min(1.0, static_cast<double>(longest_side) / std::max(width, height));
  *new_width = std::max(1, static_cast<int>(std::lround(width * scale)));
  *new_height = std::max(1, static_cast<int>(std::lround(height * scale)));
}

}  // namespace

Camera WorkingCamera(const Camera& camera, int longest_side, const Similarity& field_from_world,
                     const NdcSpace& ndc) {
  int width = 0, height = 0;
  WorkingSize(camera.width, camera.height, longest_side, &width, &height);
  const Camera followed =
      camera.MaxCornerDistortion() > kDistortionThreshold ? camera : camera.Undistorted();
  Camera working = followed.Resized(width, height).Transformed(field_from_world);
  working.ndc = ndc;
  return working;
}

std::vector<Camera> WorkingCameras(const Capture& capture, int longest_side,
                                   const Similarity& field_from_world, const NdcSpace& ndc) {
  std::vector<Camera> cameras;
  for (const CaptureView& view : capture.views)
    cameras.push_back(WorkingCamera(view.camera, longest_side, field_from_world, ndc));
  return cameras;
}

Image ReadWorkingPhoto(const CaptureView& view, int longest_side, const PhotoGain& gain) {
  Image photo = ReadImage(view.path);
  if (photo.width != view.camera.width || photo.height != view.camera.height)
    throw Error(ExitCode::kInput,
                std::to_string(photo.width) + " x " + std::to_string(photo.height) +
                    " pixels, but its camera has " + std::to_string(view.camera.width) + " x " +
                    std::to_string(view.camera.height),
                view.path, "the staged photo was changed: use --restart-from pose");
  if (photo.channels != 3) throw Error(ExitCode::kInput, "not an RGB picture", view.path);
  int width = 0, height = 0;
  WorkingSize(photo.width, photo.height, longest_side, &width, &height);
  if (width != photo.width || height != photo.height) photo = Resize(photo, width, height);
  UndoGain(gain, &photo);
  return photo;
}

Image ReadWorkingMask(const CaptureView& view, int longest_side) {
  const std::string path = StagedMaskOf(view.path);
  if (!std::filesystem::is_regular_file(path)) return {};
  Image mask = ReadImage(path);
  int width = 0, height = 0;
  WorkingSize(mask.width, mask.height, longest_side, &width, &height);
  if (width != mask.width || height != mask.height) mask = Resize(mask, width, height);
  Image kept(width, height, 1);
  constexpr float kWhole = 1 - 1e-4f;  // and rounding
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    kept.pixels[p] = mask.pixels[p * mask.channels] > kWhole ? 1.0f : 0.0f;
  return kept;
}

void LeaveOutMasked(const CaptureView& view, int longest_side, Image* picture) {
  const Image kept = ReadWorkingMask(view, longest_side);
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    if (kept.pixels[p] < 0.5f)
      std::fill_n(&picture->pixels[p * picture->channels], picture->channels,
                  std::numeric_limits<float>::quiet_NaN());
}

void FillMasked(const Image& kept, const Image& render, Image* photo) {
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    if (kept.pixels[p] < 0.5f)
      for (int c = 0; c < 3; ++c)
        photo->pixels[3 * p + c] = std::clamp(render.pixels[3 * p + c], 0.0f, 1.0f);
}

Image ReadPhotoToFit(const CaptureView& view, int longest_side, const PhotoGain& gain) {
  Image photo = ReadWorkingPhoto(view, longest_side, gain);
  LeaveOutMasked(view, longest_side, &photo);
  return HasColor(photo) ? photo : Image();
}

std::vector<int> ViewIndices(const Capture& capture, int holdout, bool held_out) {
  std::vector<int> indices;
  for (size_t i = 0; i < capture.views.size(); ++i)
    if (IsHeldOut(i, holdout) == held_out) indices.push_back(static_cast<int>(i));
  return indices;
}

std::string ComparisonNote(const Camera& common) {
  return "the photos differ in size or lens: neighbouring views are compared on frames of one "
         "camera (" +
         std::to_string(common.width) + "x" + std::to_string(common.height) +
         " px) at each photo's place";
}

Image DepthAlongRays(const Camera& camera, Image depth) {
  const Vec3d forward = camera.Forward();
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const Vec3d ray = camera.WorldRay(x + 0.5, y + 0.5).direction;
      *depth.at(x, y) = static_cast<float>(*depth.at(x, y) / Dot(ray, forward));
    }
  return depth;
}

}  // namespace regrade
