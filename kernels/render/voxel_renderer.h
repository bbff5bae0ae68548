// Renders a field of voxels.
#pragma once

#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/kind_renderer.h"

namespace regrade {

std::unique_ptr<KindRenderer> MakeVoxelRenderer(const RadianceField& field, Backend backend);
std::unique_ptr<KindRenderer> TakeVoxels(RadianceField&& field, Backend backend);

}  // namespace regrade
