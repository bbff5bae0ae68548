// A field's appearance sent through the network: the same geometry, restyled coefficients.
#pragma once

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

// Of the field's own basis; texels of background spheres go through it as plain colours. Throws
// Interrupted on kStop.
Appearance ApplyNetwork(const LipschitzNetwork& network, const RadianceField& field,
                        const ProgressFunction& progress = nullptr);

}  // namespace regrade
