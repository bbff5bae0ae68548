// Exact motion for frames of any program: their cameras and depth maps from files.
#pragma once

#include <string>
#include <vector>

#include "evaluate/pair_motion.h"
#include "pipeline/commands/frame_folder.h"

namespace regrade {

// Cameras of a transforms.json that lists the reference's frames (see transforms_json.h), and a
// folder with a depth map of each, NumPy's .npy of [H, W] float32 or float64: distance along
// the optical axis in the cameras' unit, of the frames' size; not positive or not finite is no
// surface. Both belong to frames by PairNames. `notices` gets a sentence where that was by
// order.
//
// Errors (kInput): a frame without camera or depth map, another size, a damaged file; depth
// maps are read when they are asked for.
GeometrySource GivenGeometry(const std::string& poses, const std::string& depth,
                             const FrameFolder& reference, std::vector<std::string>* notices);

}  // namespace regrade
