// Whether poses that were given can show depth, and through what lenses.
#pragma once

#include <string>

#include "kernels/scene/capture.h"

namespace regrade {

// Poses without any baseline show no depth: refused if nine tenths of the points are seen under
// less than this, in degrees (about the four pixels of a phone's photo by which features are
// wrong at most), or the cameras' extent subtends less at the scene's known distance. Without
// points and distances, if all cameras are at one place up to rounding.
inline constexpr double kNoParallaxDeg = 0.25;

// Throws Error(kScene) for poses without parallax, and for a lens that folds the picture over,
// with the photo and the radius. `poses` is their file or folder.
void RequireSoundPoses(const Capture& capture, const std::string& poses);

}  // namespace regrade
