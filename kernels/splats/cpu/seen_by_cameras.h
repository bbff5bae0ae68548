// Which splats cameras see.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

// Marks in `seen` [splats] those that are in the picture of one of the cameras, pinholes: a
// picture of these splats alone has the same bits. Colours are not looked at.
void MarkSeenSplats(const SplatsView<float>& splats, const std::vector<Camera>& cameras,
                    const SplatOptions& options, std::vector<uint8_t>* seen);

}  // namespace regrade
