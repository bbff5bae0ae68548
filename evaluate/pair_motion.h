// Flow and occlusion mask of a frame pair, computed once for all sequences that are compared.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "evaluate/flow_field.h"
#include "evaluate/frame_source.h"
#include "evaluate/occlusion.h"
#include "kernels/scene/camera.h"

namespace regrade {

// From frame i to frame j, on frame i's grid; flow in pixels.
struct PairMotion {
  FlowField flow;
  OcclusionMask mask;
};
using PairMotionFunction = std::function<PairMotion(int i, int j)>;

// Motion from frame i to frame j, given both. `flow` is a method of optical_flow.h, or
// "files:DIR", where DIR holds 00003_00004.flo for the pair (3, 4), of the frames' size (see
// flow_folder.h, also for `frames`), or "onnx:FILE", a network (see pair_network.h). Errors:
// those of the source.
using PairFlowFunction =
    std::function<FlowField(int i, int j, const Image& from, const Image& to)>;
PairFlowFunction PairFlow(const std::string& flow, const std::vector<int64_t>& frames = {});

inline constexpr char kFlowFiles[] = "files:";

// Input of mode "geometry" for a frame: depth along the ray in world units (see
// geometric_flow.h), and the camera.
struct FrameGeometry {
  Image depth;
  Camera camera;
};
using GeometrySource = std::function<FrameGeometry(int)>;
int64_t CachedBytes(const FrameGeometry& geometry);  // for OrderedCache

// Motion estimated from frames, in both directions by PairFlow. `mode` is lai2018 or ruder2016
// (see occlusion.h). Any thread may ask; `kept` frames stay in memory, which come from one
// thread at a time. Errors: kUsage for unknown names, kInput from flow and files.
PairMotionFunction EstimatedMotion(const FrameSource& frames, const std::string& mode,
                                   const std::string& flow, int64_t kept = 2,
                                   const std::vector<int64_t>& flow_frames = {});

// Motion from depth and cameras, see EQ(geometric-flow); `kept` as above. Errors: kInput if
// sizes differ.
PairMotionFunction GeometricMotion(const GeometrySource& geometry, int64_t kept = 2);

}  // namespace regrade
