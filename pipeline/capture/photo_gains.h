// Gains of photos by exposure, white balance and the lens's falloff: undone where photos are
// read, and stored beside the poses.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/refinement/exposure.h"
#include "reconstruct/refinement/lens_falloff.h"

namespace regrade {

// What a camera's exposure, white balance and lens made of one photo.
struct PhotoGain {
  Vec3d light{1, 1, 1};  // its linear light is this times that of the capture's mean photo
  // Clipped values were at least this bright. They are moved this fraction of the way from
  // there to white: the part of what bright photos clip that dark photos clip, too.
  double highlights = 0;
  LensFalloff falloff = {};

  bool operator==(const PhotoGain&) const = default;
};

// Leaves a photo unchanged, bit for bit.
inline const PhotoGain kAsTaken{};

// One for each view of the capture, or none at all where nothing is undone.
struct PhotoGains {
  std::vector<PhotoGain> of_view;

  PhotoGain Of(int view) const { return of_view.empty() ? kAsTaken : of_view[view]; }
};

// `clipped`: for each view the fraction of its pixels that are clipped, by channel.
PhotoGains GainsOf(const ExposureEstimate& estimate, const std::vector<Vec3d>& clipped);

// Converts the photo to the capture's mean exposure: linear values over gain, clipped to [0,
// 1]. NaN stays NaN, here and below.
void UndoGain(const PhotoGain& gain, Image* photo);
// The inverse: the render as a camera of that gain would show it.
void PutGain(const PhotoGain& gain, Image* picture);

// exposure.json in the folder poses/: one row a photo, with the evidence. Removes the file
// where there are no gains.
inline constexpr char kExposureFile[] = "exposure.json";
void WriteGains(const std::string& poses, const Capture& capture,
                const ExposureEstimate& estimate, const PhotoGains& gains);
// The file's rows, an input of stages that read photos; null where there is no file.
JsonValue StoredGainRows(const std::string& poses);
// The gains that the field was fitted with. Throws Error(kInput) for those of another capture.
PhotoGains ReadGains(const std::string& poses, const Capture& capture);

}  // namespace regrade
