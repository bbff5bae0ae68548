// The PSNR that a linear colour map alone reaches: the baseline that the network must beat.
#pragma once

#include <optional>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

// PSNR, measured as psnr_to_2d_db, of the field under the better of two maps carried into its
// coefficients (see EQ(sh-color-map)): the Monge-Kantorovich map between the pooled colours of
// `source` and `views_2d`, and the least-squares map between their pixels. The better one is
// chosen on the frames, and rendered at `cameras`. Pixels of `views_2d` that are not finite do
// not count.
std::optional<double> LinearMapPsnr(const RadianceField& field,
                                    const std::vector<Camera>& cameras,
                                    const FrameSource& source, const FrameSource& views_2d,
                                    const FrameSource& transmittance,
                                    const ProgressFunction& progress);

}  // namespace regrade
