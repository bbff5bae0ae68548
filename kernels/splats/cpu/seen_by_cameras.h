// Which splats cameras see.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

// [splats]: 1 for those in the picture of at least one of the cameras, which are pinholes. A
// picture of these splats alone has the same bits. Colours are not looked at.
std::vector<uint8_t> SeenSplats(const SplatsView<float>& splats,
                                const std::vector<Camera>& cameras,
                                const SplatOptions& options);

}  // namespace regrade
