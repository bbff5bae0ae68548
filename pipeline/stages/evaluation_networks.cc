#include "pipeline/stages/evaluation_networks.h"

#include "evaluate/pair_network.h"
#include "pipeline/program/crash_probe.h"

namespace regrade {
namespace {

void Probe(const std::string& path) {
  RunCrashProbe(
      [&] {
        const Image picture(64, 64, 3);
        PairNetwork(path).Distance(picture, picture);
      },
      path);
  const PairNetwork opened(path);
}

}  // namespace

void ProbeEvaluationNetworks(const ConsistencyOptions& options) {
  constexpr char kOnnx[] = "onnx:";
  if (options.flow.starts_with(kOnnx)) Probe(options.flow.substr(sizeof(kOnnx) - 1));
  if (!options.lpips.empty()) Probe(options.lpips);
}

}  // namespace regrade
