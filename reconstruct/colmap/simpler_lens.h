// Simpler lens models, for photos that do not determine a whole one: the mapper starts again
// from the same features and matches with other cameras.
#pragma once

#include <string>
#include <vector>

#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_strategies.h"

namespace regrade {

// What is estimated of a lens.
enum class LensFreedom {
  kFull,          // all that the strategy and the final adjustment allow
  kSquarePixels,  // one focal length and one distortion coefficient; centred
  kHeldFocal,     // nothing: the focal length is given, without distortion; centred
};

// "", "one focal length", "focal length held".
const char* NameOf(LensFreedom freedom);

// The focal length of EXIF or, where that is unknown, of a lens that sees 50 degrees along the
// picture's longer side; pixels.
double HeldFocal(const CameraGroup& group);

// How the held focal lengths are known, for the user.
std::string HeldFocalText(const std::vector<CameraGroup>& groups);

// A model without images: the camera of each group, with the id that the database gave it if
// the groups were extracted in this order. kSquarePixels starts as extraction does; kHeldFocal
// keeps the strategy's lens, without distortion.
ColmapModel StartOf(const std::vector<CameraGroup>& groups, const PoseStrategy& strategy,
                    LensFreedom freedom);

// Changes the arguments of a mapping of all features and matches: it starts from the model in
// the folder `start`, and writes one model to `output`.
void MapFrom(const std::string& start, const std::string& output, LensFreedom freedom,
             ColmapArguments* arguments);

}  // namespace regrade
