// The capture as stages after "pose" use it: photos at working size with their exposure gains
// undone, cameras to match, and masks.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/field/field_kind.h"
#include "kernels/scene/capture.h"
#include "pipeline/capture/kept_photos.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

// A lens that moves no corner of its photo by more than this, in pixels, is taken as a pinhole:
// less than half a pixel is below the accuracy of poses, and rays without a lens model need no
// Newton steps.
inline constexpr double kDistortionThreshold = 0.5;

// The camera of a photo whose longer side is reduced to `longest_side` pixels (never enlarged),
// in a world transformed by `field_from_world`, its pixel rays in `ndc` where that is on. Its
// lens is a pinhole up to kDistortionThreshold.
Camera WorkingCamera(const Camera& camera, int longest_side, const Similarity& field_from_world,
                     const NdcSpace& ndc);

// Indices below are those of Capture::views. Copies share the capture.
class WorkingViews {
 public:
  // Photos as taken, cameras in the capture's world. `holdout`: see HeldOutViews.
  WorkingViews(Capture capture, int photo_size, int holdout);

  WorkingViews InField(const Similarity& field_from_world, const NdcSpace& ndc) const;
  // As `stored` needs its cameras, see CamerasFor.
  WorkingViews InField(const StoredField& stored) const;
  // Photos are undistorted, and what they do not show is masked.
  WorkingViews Pinholes() const;
  // Pinholes, for a kind of field that has no picture through a lens.
  WorkingViews CamerasFor(const FieldKind& kind) const;
  // The photos' own lenses.
  WorkingViews Lenses() const;
  WorkingViews WithGains(PhotoGains gains) const;
  WorkingViews AsTaken() const { return WithGains({}); }
  WorkingViews AtSize(int photo_size) const;
  // Photos that are read are kept there; null: nowhere.
  WorkingViews KeepingPhotos(std::shared_ptr<KeptPhotos> kept) const;

  const Capture& capture() const { return *capture_; }
  const CaptureView& View(int i) const { return capture_->views[i]; }
  int count() const { return static_cast<int>(capture_->views.size()); }
  int photo_size() const { return photo_size_; }
  PhotoGain Gain(int i) const { return gains_.Of(i); }

  // Indices of the views that are fitted, and of those kept for measuring.
  std::vector<int> Training() const { return Indices(false); }
  std::vector<int> HeldOut() const { return Indices(true); }

  Camera CameraOf(int i) const;
  std::vector<Camera> Cameras() const;

  // The photo at the size of its camera, 3 channels, its gain undone. Throws Error(kInput).
  Image Photo(int i) const;
  // [H, W, 1]: 1 where no part of a pixel is masked (--photo-masks) or beyond an undistorted
  // photo, else 0. Empty (0 x 0) where the photo has no mask.
  Image Mask(int i) const;
  // Sets masked pixels of a picture of that size to NaN: they are neither fitted nor measured.
  void LeaveOutMasked(int i, Image* picture) const;
  // A picture in the pixels of photo i, of any size, as CameraOf(i) sees it: undistorted where
  // photos are, with the nearest colours beyond the photo.
  Image AsSeen(int i, Image picture) const;
  // Photo without what is masked; empty (0 x 0) where nothing is left of it.
  Image PhotoToFit(int i) const;

 private:
  std::vector<int> Indices(bool held_out) const;
  // Of photo i as it was taken, before it is undistorted.
  Camera LensOf(int i) const;
  bool IsUndistorted(int i) const { return pinholes_ && LensOf(i).lens != LensModel::kPinhole; }

  std::shared_ptr<const Capture> capture_;
  std::shared_ptr<KeptPhotos> kept_;
  int photo_size_, holdout_;
  PhotoGains gains_;
  Similarity field_from_world_;
  NdcSpace ndc_;
  bool pinholes_ = false;
};

// Of a folder poses/ with the gains that are stored there (ReadGains), cameras in the capture's
// world. Throws Error(kInput).
WorkingViews ReadWorkingViews(const std::string& poses, int photo_size, int holdout);

// Replaces masked pixels of a photo that a 2D method is given by those of `render`, of the same
// view. `kept` as of WorkingViews::Mask.
void FillMasked(const Image& kept, const Image& render, Image* photo);

// "the photos differ in size or lens: neighbouring views are compared on frames of one camera
// (480x360 px) at each photo's place"
std::string ComparisonNote(const Camera& common);

// The renderer's depth is along the optical axis; the evaluator needs it along each ray.
Image DepthAlongRays(const Camera& camera, Image depth);

}  // namespace regrade
