// Gradients by all values of splats as arrays on the device.
#pragma once

#include "kernels/splats/cuda/device_splats.h"
#include "kernels/splats/cuda/splat_adjoint.h"

namespace regrade {

// `gradient` becomes that of view.splats, with zeros for splats that are not seen, and grows if
// it must. The gradient by the background is downloaded, which waits.
void StoreSplatGradients(const SplatSumsView& view, DeviceSplats* gradient);

}  // namespace regrade
