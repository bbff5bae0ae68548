// Reads and writes Middlebury .flo flow files, with all sizes checked.
#pragma once

#include <cstdint>
#include <string>

#include "evaluate/flow_field.h"

namespace regrade {

// Layout, little-endian: float 202021.25, int32 width, int32 height, then width x height pairs
// (u, v) of float32 by rows. The format marks unknown motion by |value| > 1e9; such values and
// non-finite ones become NaN in both components of the pixel, and are counted.
//
// Errors (kInput): no file, wrong mark, a side outside [1, 2^15], fewer or more bytes than the
// header specifies. Memory is allocated only after the file's size has confirmed the header.
FlowField ReadFlowFile(const std::string& path, int64_t* unknown_pixels = nullptr);

// Unknown motion is written as 1e10. Throws Error (kResources) if writing fails.
void WriteFlowFile(const std::string& path, const FlowField& flow);

// The file name for the motion from frame i to frame j: "00003_00004.flo".
std::string FlowFileName(int from, int to);

}  // namespace regrade
