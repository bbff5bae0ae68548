// Fuzz targets: flow files of other programs.
#include <cmath>

#include "evaluate/flow_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

std::vector<std::string> Seeds() {
  FlowField flow(5, 3);
  for (size_t i = 0; i < flow.uv.size(); ++i) flow.uv[i] = 0.25f * static_cast<float>(i);
  flow.uv[4] = flow.uv[5] = NAN;
  const std::string path = FuzzFolder() + "/seed.flo";
  WriteFlowFile(path, flow);
  return {ReadText(path)};
}

bool Read(std::string_view bytes) {
  const std::string path = FuzzFile("a.flo", bytes);
  return Accepts([&path, bytes] {
    int64_t unknown = 0, counted = 0;
    const FlowField flow = ReadFlowFile(path, &unknown);
    FuzzRequire(flow.uv.size() * sizeof(float) + 12 == bytes.size(), "a size has its bytes");
    for (size_t i = 0; i < flow.uv.size(); i += 2) {
      counted += std::isnan(flow.uv[i]);
      FuzzRequire(std::isnan(flow.uv[i]) == std::isnan(flow.uv[i + 1]) &&
                      !(std::abs(flow.uv[i]) > 1e9f),
                  "unknown motion is NaN, known motion is not");
    }
    FuzzRequire(counted == unknown, "unknown pixels are counted");
  });
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  bytes = MutateBytes(std::move(bytes), random);
  // Half of them get the size that their length allows.
  if (bytes.size() >= 20 && random->Chance(0.5)) {
    bytes.resize(bytes.size() - (bytes.size() - 12) % 8);
    const size_t pixels = (bytes.size() - 12) / 8;
    for (size_t i = 0; i < 8; ++i)
      bytes[4 + i] = static_cast<char>(i < 4 ? pixels >> (8 * i) & 255 : i == 4);
  }
  return bytes;
}

}  // namespace

std::vector<FuzzTarget> FlowTargets() { return {{"flow_file", Seeds, Read, Mutate, 50000}}; }

}  // namespace regrade::testing
