// The capture as the later stages use it: photos at working size, cameras to match.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/capture/photo_gains.h"

namespace regrade {

// A lens that moves no corner of its photo by more than this, in pixels, is taken as a pinhole:
// less than half a pixel is below what poses are known to, and rays without a lens model need
// no Newton steps.
inline constexpr double kDistortionThreshold = 0.5;

// The camera of a photo whose longer side is cut to `longest_side` pixels (never enlarged), in
// a world transformed by `field_from_world`, its pixel rays in `ndc` where that is on. Its lens
// is a pinhole up to kDistortionThreshold.
Camera WorkingCamera(const Camera& camera, int longest_side, const Similarity& field_from_world,
                     const NdcSpace& ndc);

// Working cameras of all views, in their order.
std::vector<Camera> WorkingCameras(const Capture& capture, int longest_side,
                                   const Similarity& field_from_world, const NdcSpace& ndc);

// The photo at the size of its working camera, 3 channels, rid of its gain (photo_gains.h).
Image ReadWorkingPhoto(const CaptureView& view, int longest_side, const PhotoGain& gain);

// What --photo-masks keeps of it: [H, W, 1], 1 where no part of a pixel is masked, else 0.
// Empty (0 x 0) where the photo has no mask.
Image ReadWorkingMask(const CaptureView& view, int longest_side);

// NaN where the photo is masked: such pixels are neither fitted nor measured. `picture` has the
// working size.
void LeaveOutMasked(const CaptureView& view, int longest_side, Image* picture);

// What a 2D method is given instead of a masked photo: `render`, of the same view, where `kept`
// (ReadWorkingMask) is 0.
void FillMasked(const Image& kept, const Image& render, Image* photo);

// ReadWorkingPhoto without what is masked; empty (0 x 0) where nothing is left of it.
Image ReadPhotoToFit(const CaptureView& view, int longest_side, const PhotoGain& gain);

// Indices of views that are fitted, or of those that are kept for measuring.
std::vector<int> ViewIndices(const Capture& capture, int holdout, bool held_out);

// "the photos differ in size or lens: neighbouring views are compared on frames of one camera
// (480x360 px) at each photo's place"
std::string ComparisonNote(const Camera& common);

// The renderer's depth is along the optical axis; the evaluator wants it along each ray.
Image DepthAlongRays(const Camera& camera, Image depth);

}  // namespace regrade
