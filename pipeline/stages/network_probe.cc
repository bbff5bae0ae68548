#include "pipeline/stages/network_probe.h"

#include <charconv>
#include <cstdlib>
#include <new>

#include "evaluate/edge_map.h"
#include "evaluate/edge_network.h"
#include "evaluate/pair_network.h"
#include "kernels/base/error.h"
#include "pipeline/capture/guessed_depths.h"
#include "pipeline/program/crash_probe.h"
#include "stylize/image/onnx_stylizer.h"
#include "stylize/image/region_features.h"

namespace regrade {
namespace {

constexpr char kStyle[] = "style", kPair[] = "pair", kEdges[] = "edges", kRegions[] = "regions",
               kDepths[] = "depths";

void OpenStyleNetwork(const std::string& path) { MakeOnnxStylizer(path, 64, Image(64, 64)); }

void OpenFeatureNetwork(const std::string& path) {
  const std::vector<Image> pictures = {Image(64, 64), Image(48, 64)};
  const RegionFeatures opened(path, pictures);
  for (const Image& picture : pictures) opened.Of(picture);
}

void OpenDepthNetwork(const std::string& path) { GuessDepth(OnnxModel(path), Image(64, 48)); }

void ProbePairNetwork(const std::string& path) {
  RunCrashProbe(kPair, path);
  const PairNetwork opened(path);
}

void ProbeEdgeNetwork(const std::string& path) {
  if (path.empty()) return;
  RunCrashProbe(kEdges, path);
  const EdgeNetwork opened(path);
}

}  // namespace

void ProbeStyleNetwork(const std::string& path) {
  RunCrashProbe(kStyle, path);
  OpenStyleNetwork(path);
}

void ProbeFeatureNetwork(const std::string& path) {
  RunCrashProbe(kRegions, path);
  OpenFeatureNetwork(path);
}

void ProbeDepthNetwork(const std::string& path) {
  RunCrashProbe(kDepths, path);
  OpenDepthNetwork(path);
}

void ProbeEvaluationNetworks(const ConsistencyOptions& options) {
  constexpr char kOnnx[] = "onnx:";
  if (options.flow.starts_with(kOnnx)) ProbePairNetwork(options.flow.substr(sizeof(kOnnx) - 1));
  if (!options.lpips.empty()) ProbePairNetwork(options.lpips);
  if (options.edges != kGradientEdges) ProbeEdgeNetwork(options.edges);
}

void RunNetworkProbe(const std::vector<std::string>& arguments) {
  int64_t memory = 0;
  if (arguments.size() == 3)
    std::from_chars(arguments[0].data(), arguments[0].data() + arguments[0].size(), memory);
  if (memory <= 0) throw UsageError("expects MEMORY KIND FILE", kProbeFlag);
  ApplyProbeLimits(memory);
  const std::string &kind = arguments[1], &path = arguments[2];
  try {
    if (kind == kStyle) return OpenStyleNetwork(path);
    if (kind == kRegions) return OpenFeatureNetwork(path);
    if (kind == kDepths) return OpenDepthNetwork(path);
    const Image picture(64, 64, 3);
    if (kind == kEdges) return (void)EdgeNetwork(path).EdgeMap(picture);
    if (kind == kPair) {
      PairNetwork(path).Distance(picture, picture);
      return;
    }
  } catch (const std::bad_alloc&) {
    std::_Exit(kProbeOutOfMemory);
  }
  throw UsageError("unknown kind of probe", kind);
}

}  // namespace regrade
