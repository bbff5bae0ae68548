// What a photographer may do to photos, as exact functions: the truth that a lifted edit is
// compared with.
#pragma once

#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "kernels/synthetic/synthetic_scene.h"

namespace regrade {

enum class SynthGrade { kNone, kGlobal, kLocal, kObject, kVignette };

// "", global, local, object or vignette. Throws Error(kUsage).
SynthGrade ParseSynthGrade(const std::string& name);

// The global grade of a colour in [0, 1]: a contrast curve, warm lights and cold shadows, and
// greens turned towards yellow. Smooth; its steepest slope is below 2.5.
Vec3d GradeColor(const Vec3d& c);

// Factor of the vignette at r half diagonals from the centre: 1 - 0.35 r^2.
double VignetteFactor(double r);

// The photo of `camera` as graded:
//   global    GradeColor of each pixel;
//   local     darker by the place in the scene: from 1 at a quarter of its extent along x to
//             0.6 at three quarters;
//   object    the red and green channels of `solid` exchanged;
//   vignette  GradeColor, then VignetteFactor.
// `depth` as of SyntheticView; `solid` an index into the scene's solids.
void ApplyGrade(SynthGrade grade, const SyntheticScene& scene, const Camera& camera,
                const Image& depth, int solid, Image* color);

}  // namespace regrade
