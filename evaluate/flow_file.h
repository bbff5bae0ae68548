// Flow files in the Middlebury .flo format, read with every size checked.
#pragma once

#include <cstdint>
#include <string>

#include "evaluate/flow_field.h"

namespace regrade {

// Layout, little-endian: float 202021.25, int32 width, int32 height, then width x height pairs
// (u, v) of float32 by rows. The format marks unknown motion by |value| > 1e9; such values and
// those that are not finite become NaN in both components of the pixel, and are counted.
//
// Errors (kInput): no file, wrong mark, a side outside [1, 2^15], fewer or more bytes than the
// header guarantees. Nothing is allocated before the file's own size has confirmed the header.
FlowField ReadFlowFile(const std::string& path, int64_t* unknown_pixels = nullptr);

// Unknown motion is written as 1e10. Throws Error (kResources) when the disk refuses.
void WriteFlowFile(const std::string& path, const FlowField& flow);

// Name of the file that holds the motion from frame i to frame j: "00003_00004.flo".
std::string FlowFileName(int from, int to);

}  // namespace regrade
