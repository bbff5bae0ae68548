#include "pipeline/stages/network_probe.h"

#include <charconv>
#include <cstdlib>
#include <new>

#include "evaluate/pair_network.h"
#include "kernels/base/error.h"
#include "pipeline/program/crash_probe.h"
#include "stylize/image/onnx_stylizer.h"
#include "stylize/image/region_features.h"

namespace regrade {
namespace {

constexpr char kStyle[] = "style", kPair[] = "pair", kFeatures[] = "features";

void OpenStyleNetwork(const std::string& path) { MakeOnnxStylizer(path, 64, Image(64, 64)); }

void OpenFeatureNetwork(const std::string& path) {
  const std::vector<Image> pictures = {Image(64, 64), Image(48, 64)};
  const RegionFeatures opened(path, pictures);
  for (const Image& picture : pictures) opened.Of(picture);
}

void ProbePairNetwork(const std::string& path) {
  RunCrashProbe(kPair, path);
  const PairNetwork opened(path);
}

}  // namespace

void ProbeStyleNetwork(const std::string& path) {
  RunCrashProbe(kStyle, path);
  OpenStyleNetwork(path);
}

void ProbeFeatureNetwork(const std::string& path) {
  RunCrashProbe(kFeatures, path);
  OpenFeatureNetwork(path);
}

void ProbeEvaluationNetworks(const ConsistencyOptions& options) {
  constexpr char kOnnx[] = "onnx:";
  if (options.flow.starts_with(kOnnx)) ProbePairNetwork(options.flow.substr(sizeof(kOnnx) - 1));
  if (!options.lpips.empty()) ProbePairNetwork(options.lpips);
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
    if (kind == kFeatures) return OpenFeatureNetwork(path);
    if (kind == kPair) {
      const Image picture(64, 64, 3);
      PairNetwork(path).Distance(picture, picture);
      return;
    }
  } catch (const std::bad_alloc&) {
    std::_Exit(kProbeOutOfMemory);
  }
  throw UsageError("unknown kind of probe", kind);
}

}  // namespace regrade
