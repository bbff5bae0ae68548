#include "evaluate/pair_motion.h"

#include "evaluate/flow_file.h"
#include "evaluate/geometric_flow.h"
#include "evaluate/optical_flow.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr char kFilesPrefix[] = "files:";

OcclusionMask MakeMask(const std::string& mode, const FlowField& forward,
                       const FlowField& backward) {
  if (mode == "lai2018") return MaskLai2018(forward, backward);
  if (mode == "ruder2016") return MaskRuder2016(forward, backward);
  throw Error(ExitCode::kUsage, "unknown consistency mode", mode,
              "choose lai2018, ruder2016 or geometry (which needs depth and cameras)");
}

}  // namespace

PairMotionFunction EstimatedMotion(const FrameSource& frames, const std::string& mode,
                                   const std::string& flow) {
  MakeMask(mode, FlowField(1, 1), FlowField(1, 1));  // an unknown mode is refused before work
  if (flow.starts_with(kFilesPrefix)) {
    const std::string folder = flow.substr(sizeof(kFilesPrefix) - 1);
    return [=](int i, int j) {
      PairMotion motion;
      motion.flow = ReadFlowFile(folder + "/" + FlowFileName(i, j));
      const std::string backward_path = folder + "/" + FlowFileName(j, i);
      const FlowField backward = ReadFlowFile(backward_path);
      if (!motion.flow.SameSize(backward))
        throw Error(ExitCode::kInput, "forward and backward flow differ in size",
                    backward_path);
      motion.mask = MakeMask(mode, motion.flow, backward);
      return motion;
    };
  }
  return [=](int i, int j) {
    const Image from = frames.frame(i), to = frames.frame(j);
    PairMotion motion;
    motion.flow = ComputeFlow(from, to, flow);
    motion.mask = MakeMask(mode, motion.flow, ComputeFlow(to, from, flow));
    return motion;
  };
}

PairMotionFunction KnownMotion(const GeometrySource& geometry) {
  return [=](int i, int j) {
    const FrameGeometry a = geometry(i), b = geometry(j);
    if (!a.depth.SameSize(b.depth))
      throw Error(ExitCode::kInput, "depth images differ in size",
                  "frames " + std::to_string(i) + " and " + std::to_string(j));
    PairMotion motion;
    Image visible;
    motion.flow = GeometricFlow(a.depth, a.camera, b.depth, b.camera, &visible);
    motion.mask = GeometricMask(motion.flow, visible);
    return motion;
  };
}

}  // namespace regrade
