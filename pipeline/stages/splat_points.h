// Points of a scene of splats, as COLMAP finds them in photos: the scene's box and the nearest
// distance come from them.
#pragma once

#include <string>

#include "kernels/field/radiance_field.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/capture.h"

namespace regrade {

// Takes some splats that at least two views show, not hidden by others, as the capture's points
// and adds them to the model in `sparse_folder`, whose images are the capture's views. `field`
// is in the world of the views and is drawn by `renderer`. Throws Error(kInput) if the views
// show fewer than kFewestSplatPoints, naming `cameras`: they are of another world.
inline constexpr size_t kFewestSplatPoints = 50;
void AddSplatPoints(const RadianceField& field, const FieldRenderer& renderer,
                    const std::string& sparse_folder, const std::string& cameras,
                    Capture* capture);

}  // namespace regrade
