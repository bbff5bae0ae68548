// A field's appearance sent through the network: the same geometry, restyled coefficients.
#pragma once

#include <functional>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

// With the harmonics of the network's row: nine a channel at least, for a 2D method that maps
// each view by itself needs directions, also where the scene's own colours have none. Texels of
// background spheres go through it as plain colours. Throws InputError for a network that was
// made for another NetworkRow, and Interrupted on kStop.
Appearance ApplyNetwork(const LipschitzNetwork& network, const RadianceField& field,
                        const ProgressFunction& progress = nullptr);

// The same with another forward pass, such as that of rounded weights: output [n, stride] of
// features [n, stride], see NetworkRow.
using ForwardPass = std::function<void(const float* features, int64_t n, float* output)>;
Appearance ApplyForward(const ForwardPass& forward, float position_scale,
                        const RadianceField& field, const ProgressFunction& progress = nullptr);

}  // namespace regrade
