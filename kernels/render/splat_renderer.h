// Renders a field of splats.
#pragma once

#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/kind_renderer.h"

namespace regrade {

std::unique_ptr<KindRenderer> MakeSplatRenderer(const RadianceField& field, Backend backend);
std::unique_ptr<KindRenderer> TakeSplats(RadianceField&& field, Backend backend);

}  // namespace regrade
