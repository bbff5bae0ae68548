// Learning a style on a CUDA device: the loss and its gradient by the touched voxels, and the
// network over a whole field. Held to gradient_aggregation.h and apply_network.h by the parity
// table.
#pragma once

#include <memory>

#include "stylize/cuda/device_style_field.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

// The field is not one that is being fitted; it stays with the caller. Gradients are of
// TF32 products, loss and hidden sums as good as float's; with options.exact_sums they do not
// depend on the order in which samples are added, and two runs are bitwise equal. Throws
// Error(kResources) without a device, or where its memory is too small.
std::unique_ptr<StyleLoss> MakeDeviceStyleLoss(const DeviceStyleField* field,
                                               const AggregationOptions& options);

// The colours of every record, and of the background's layers, become what the network makes of
// them.
void RestyleOnDevice(const LipschitzNetwork& network, DeviceStyleField* field);

}  // namespace regrade
