// The PSNR that a linear colour map alone reaches: the baseline that the network must beat.
#pragma once

#include <optional>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/camera.h"
#include "pipeline/capture/photo_gains.h"
#include "stylize/linear_map.h"

namespace regrade {

// The better of two maps on the frames, clipped as pictures are: the Monge-Kantorovich map
// between the pooled colours of `source` and `views_2d`, and the least-squares map between
// their pixels. Pixels of `views_2d` that are not finite do not count; nothing if none counts.
std::optional<ColorMap> BestLinearMap(const FrameSource& source, const FrameSource& views_2d);

// PSNR, measured as psnr_to_2d_db, of the field under BestLinearMap carried into its
// coefficients (see EQ(sh-color-map)) and rendered at `cameras`. The frames have `gains`: the
// map is that of frames without them, and they are put on what is rendered.
std::optional<double> LinearMapPsnr(const RadianceField& field,
                                    const std::vector<Camera>& cameras,
                                    const FrameSource& source, const FrameSource& views_2d,
                                    const FrameSource& transmittance, const PhotoGains& gains,
                                    Backend backend, const ProgressFunction& progress);

}  // namespace regrade
