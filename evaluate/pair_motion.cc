#include "evaluate/pair_motion.h"

#include <filesystem>
#include <memory>

#include "evaluate/flow_file.h"
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

// Reads the precomputed motion from frame i to frame j; `frame` is any frame of the sequence.
FlowField ReadPairFlow(const std::string& folder, int i, int j, const Image& frame) {
  const std::string path = folder + "/" + FlowFileName(i, j);
  if (!std::filesystem::exists(path))
    throw InputError(Concat("there is no flow file from frame ", i, " to frame ", j), path,
                     "every pair of --gaps needs its flow in both directions");
  FlowField flow = ReadFlowFile(path);
  if (flow.width != frame.width || flow.height != frame.height)
    throw InputError(Concat("the flow is ", flow.width, " x ", flow.height, " px, the frames ",
                            frame.width, " x ", frame.height, " px"),
                     path, "compute it at the frames' size");
  return flow;
}

}  // namespace

int64_t CachedBytes(const FrameGeometry& geometry) { return CachedBytes(geometry.depth); }

PairFlowFunction PairFlow(const std::string& flow) {
  if (flow.starts_with(kFlowFiles))
    return [folder = flow.substr(sizeof(kFlowFiles) - 1)](int i, int j, const Image& from,
                                                          const Image&) {
      return ReadPairFlow(folder, i, j, from);
    };
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
                                   const std::string& flow, int64_t kept) {
  MakeMask(mode, FlowField(1, 1), FlowField(1, 1));  // rejects an unknown mode early
  const FrameCache cache(frames.frame, kept, kFrameCacheBytes);
  return [=, compute = PairFlow(flow)](int i, int j) {
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
