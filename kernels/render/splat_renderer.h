// Renders a field of splats.
#pragma once

#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/render_kind.h"

namespace regrade {

std::unique_ptr<Renderer> MakeSplatRenderer(const RadianceField& field, Backend backend);
std::unique_ptr<Renderer> TakeSplats(RadianceField&& field, Backend backend);

}  // namespace regrade
