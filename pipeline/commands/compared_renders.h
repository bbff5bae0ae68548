// How far renders of two fields are apart, for what an export says of its loss.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

inline constexpr int kComparedViews = 3;  // for one number

// At most `most` views of the output folder, evenly spaced, with 400 pixels on their longer
// sides, in the frame of `stored`.
std::vector<Camera> ViewsOf(const std::string& folder, const StoredField& stored, int most);

// On the CPU.
std::vector<Image> RendersOf(const RadianceField& field, const std::vector<Camera>& cameras);

// In dB, of all pixels of all pictures together; pictures have the same sizes.
double PsnrOf(const std::vector<Image>& a, const std::vector<Image>& b);

// "its renders are 41.2 dB from the field's own, on 3 views of 400 pixels".
std::string LossText(const std::vector<Image>& own, const std::vector<Image>& after);

}  // namespace regrade
