#include "evaluate/pair_motion.h"

#include <memory>

#include "evaluate/flow_folder.h"
#include "evaluate/frame_cache.h"
#include "evaluate/geometric_flow.h"
#include "evaluate/optical_flow.h"
#include "evaluate/pair_network.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr char kOnnxPrefix[] = "onnx:";

OcclusionMask MakeMask(const std::string& mode, const FlowField& forward,
                       const FlowField& backward) {
  if (mode == "lai2018") return MaskLai2018(forward, backward);
  if (mode == "ruder2016") return MaskRuder2016(forward, backward);
  throw UsageError(
      "unknown consistency mode", mode,
      "choose lai2018, ruder2016, stylegaussian or geometry (which needs depth and "
      "cameras)");
}

}  // namespace

int64_t CachedBytes(const FrameGeometry& geometry) { return CachedBytes(geometry.depth); }

PairFlowFunction PairFlow(const std::string& flow, const std::vector<int64_t>& frames) {
  if (flow.starts_with(kFlowFiles)) {
    const auto folder =
        std::make_shared<const FlowFolder>(flow.substr(sizeof(kFlowFiles) - 1), frames);
    return [folder](int i, int j, const Image& from, const Image&) {
      return folder->Read(i, j, from.width, from.height);
    };
  }
  if (flow.starts_with(kOnnxPrefix)) {
    const auto network =
        std::make_shared<const PairNetwork>(flow.substr(sizeof(kOnnxPrefix) - 1));
    return [network](int, int, const Image& from, const Image& to) {
      return network->Flow(from, to);
    };
  }
  return [flow](int, int, const Image& from, const Image& to) {
    return ComputeFlow(from, to, flow);
  };
}

PairMotionFunction EstimatedMotion(const FrameSource& frames, const std::string& mode,
                                   const std::string& flow, int64_t kept,
                                   const std::vector<int64_t>& flow_frames) {
  MakeMask(mode, FlowField(1, 1), FlowField(1, 1));  // rejects an unknown mode early
  const FrameCache cache(frames.frame, kept, kFrameCacheBytes);
  return [=, compute = PairFlow(flow, flow_frames)](int i, int j) {
    const auto from = cache.Get(i), to = cache.Get(j);
    PairMotion motion;
    motion.flow = compute(i, j, *from, *to);
    motion.mask = MakeMask(mode, motion.flow, compute(j, i, *to, *from));
    return motion;
  };
}

PairMotionFunction GeometricMotion(const GeometrySource& geometry, int64_t kept) {
  const OrderedCache<FrameGeometry> cache(geometry, kept, kFrameCacheBytes);
  return [=](int i, int j) {
    const auto of_i = cache.Get(i), of_j = cache.Get(j);
    const FrameGeometry &a = *of_i, &b = *of_j;
    if (!a.depth.SameSize(b.depth))
      throw InputError("depth images differ in size", Concat("frames ", i, " and ", j));
    PairMotion motion;
    Image visible;
    motion.flow = GeometricFlow(a.depth, a.camera, b.depth, b.camera, &visible);
    motion.mask = GeometricMask(motion.flow, visible);
    return motion;
  };
}

}  // namespace regrade
