// Flow and mask of one pair of frames, computed once and shared by every sequence that is
// compared.
#pragma once

#include <functional>
#include <string>

#include "evaluate/flow_field.h"
#include "evaluate/frame_source.h"
#include "evaluate/occlusion.h"
#include "kernels/scene/camera.h"

namespace regrade {

// From frame i to frame j, on frame i's grid.
struct PairMotion {
  FlowField flow;
  OcclusionMask mask;
};
using PairMotionFunction = std::function<PairMotion(int i, int j)>;

// What mode "geometry" needs to know of a frame: depth along the ray (see geometric_flow.h).
struct FrameGeometry {
  Image depth;
  Camera camera;
};
using GeometrySource = std::function<FrameGeometry(int)>;

// Motion estimated from pictures. `mode` is lai2018 or ruder2016; `flow` one of
// optical_flow.h's methods, or "files:DIR", where DIR holds 00003_00004.flo and 00004_00003.flo
// for the pair (3, 4), or "onnx:FILE", a network (see pair_network.h). Files must have the
// frames' size. Errors: kUsage for unknown names, kInput from flow and files.
PairMotionFunction EstimatedMotion(const FrameSource& frames, const std::string& mode,
                                   const std::string& flow);

// Motion known from depth and cameras.
PairMotionFunction KnownMotion(const GeometrySource& geometry);

}  // namespace regrade
