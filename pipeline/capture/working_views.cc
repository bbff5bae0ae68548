#include "pipeline/capture/working_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "kernels/image/undistort_photo.h"
#include "pipeline/capture/capture_store.h"
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

Image AtWorkingSize(Image image, int longest_side) {
  int width = 0, height = 0;
  WorkingSize(image.width, image.height, longest_side, &width, &height);
  if (width == image.width && height == image.height) return image;
  return Resize(image, width, height);
}

// At working size, as it was taken.
Image Decoded(const CaptureView& view, int longest_side) {
  Image photo = ReadImage(view.path);
  if (photo.width != view.camera.width || photo.height != view.camera.height)
    throw InputError(Concat(photo.width, " x ", photo.height, " pixels, but its camera has ",
                            view.camera.width, " x ", view.camera.height),
                     view.path, "the staged photo was changed: use --restart-from pose");
  if (photo.channels != 3) throw InputError("not an RGB picture", view.path);
  return AtWorkingSize(std::move(photo), longest_side);
}

Image Filled(int width, int height, float value) {
  Image image(width, height, 1);
  std::ranges::fill(image.pixels, value);
  return image;
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

WorkingViews::WorkingViews(Capture capture, int photo_size, int holdout)
    : capture_(std::make_shared<const Capture>(std::move(capture))),
      photo_size_(photo_size),
      holdout_(holdout) {}

WorkingViews WorkingViews::InField(const Similarity& field_from_world,
                                   const NdcSpace& ndc) const {
  WorkingViews views = *this;
  views.field_from_world_ = field_from_world;
  views.ndc_ = ndc;
  return views;
}

WorkingViews WorkingViews::Pinholes() const {
  WorkingViews views = *this;
  views.pinholes_ = true;
  return views;
}

WorkingViews WorkingViews::Lenses() const {
  WorkingViews views = *this;
  views.pinholes_ = false;
  return views;
}

WorkingViews WorkingViews::InField(const StoredField& stored) const {
  return InField(stored.field_from_world, stored.ndc)
      .CamerasFor(KindOf(*stored.field.geometry));
}

WorkingViews WorkingViews::CamerasFor(const FieldKind& kind) const {
  return kind.lenses ? *this : Pinholes();
}

WorkingViews WorkingViews::WithGains(PhotoGains gains) const {
  WorkingViews views = *this;
  views.gains_ = std::move(gains);
  return views;
}

WorkingViews WorkingViews::AtSize(int photo_size) const {
  WorkingViews views = *this;
  views.photo_size_ = photo_size;
  return views;
}

WorkingViews WorkingViews::KeepingPhotos(std::shared_ptr<KeptPhotos> kept) const {
  WorkingViews views = *this;
  views.kept_ = std::move(kept);
  return views;
}

std::vector<int> WorkingViews::Indices(bool held_out) const {
  std::vector<int> indices;
  const std::vector<bool> held = HeldOutViews(*capture_, holdout_);
  for (int i = 0; i < count(); ++i)
    if (held[static_cast<size_t>(i)] == held_out) indices.push_back(i);
  return indices;
}

Camera WorkingViews::LensOf(int i) const {
  return WorkingCamera(View(i).camera, photo_size_, field_from_world_, ndc_);
}

Camera WorkingViews::CameraOf(int i) const {
  return pinholes_ ? LensOf(i).Undistorted() : LensOf(i);
}

std::vector<Camera> WorkingViews::Cameras() const {
  std::vector<Camera> cameras;
  for (int i = 0; i < count(); ++i) cameras.push_back(CameraOf(i));
  return cameras;
}

Image WorkingViews::Photo(int i) const {
  const auto decode = [&view = View(i), size = photo_size_] { return Decoded(view, size); };
  Image photo = kept_ ? kept_->At(View(i).path, photo_size_, decode) : decode();
  photo = AsSeen(i, std::move(photo));
  UndoGain(gains_.Of(i), &photo);
  return photo;
}

Image WorkingViews::Mask(int i) const {
  const std::string path = StagedMaskOf(View(i).path);
  const bool masked = std::filesystem::is_regular_file(path);
  if (!masked && !IsUndistorted(i)) return {};
  const Camera lens = LensOf(i);
  Image mask =
      masked ? AtWorkingSize(ReadImage(path), photo_size_) : Filled(lens.width, lens.height, 1);
  if (IsUndistorted(i)) mask = UndistortPhoto(mask, lens);  // NaN beyond the photo
  Image kept(mask.width, mask.height, 1);
  constexpr float kWhole = 1 - 1e-4f;  // and rounding
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    kept.pixels[p] = mask.pixels[p * mask.channels] > kWhole ? 1.0f : 0.0f;
  return kept;
}

void WorkingViews::LeaveOutMasked(int i, Image* picture) const {
  const Image kept = Mask(i);
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    if (kept.pixels[p] < 0.5f)
      std::fill_n(&picture->pixels[p * picture->channels], picture->channels,
                  std::numeric_limits<float>::quiet_NaN());
}

Image WorkingViews::PhotoToFit(int i) const {
  Image photo = Photo(i);
  LeaveOutMasked(i, &photo);
  return HasColor(photo) ? photo : Image();
}

Image WorkingViews::AsSeen(int i, Image picture) const {
  if (!IsUndistorted(i)) return picture;
  Image seen = UndistortPhoto(picture, LensOf(i).Resized(picture.width, picture.height));
  FillBeyond(&seen);
  return seen;
}

WorkingViews ReadWorkingViews(const std::string& poses, int photo_size, int holdout) {
  Capture capture = ReadCapture(poses);
  PhotoGains gains = ReadGains(poses, capture);
  return WorkingViews(std::move(capture), photo_size, holdout).WithGains(std::move(gains));
}

void FillMasked(const Image& kept, const Image& render, Image* photo) {
  for (int64_t p = 0; p < kept.num_pixels(); ++p)
    if (kept.pixels[p] < 0.5f)
      for (int c = 0; c < 3; ++c)
        photo->pixels[3 * p + c] = std::clamp(render.pixels[3 * p + c], 0.0f, 1.0f);
}

std::string ComparisonNote(const Camera& common) {
  return Concat(
      "the photos differ in size or lens: neighbouring views are compared on frames of one "
      "camera (",
      common.width, "x", common.height, " px) at each photo's place");
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
