// Edge maps by networks: what they do to a sequence's row, and refused files.
#include "evaluate/edge_network.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "evaluate/fidelity_networks.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using namespace regrade::testing;

struct Networks {
  TemporaryFolder folder;
  std::string mean = folder / "mean.onnx", edges = folder / "edges.onnx";
  Networks() {
    WriteText(mean, MeanNetwork());
    WriteText(edges, TinyEdgeNetwork());
  }
};

TEST(EdgeNetwork, RefusalsNameTheFile) {
  const Networks networks;
  const Image picture = ConstantImage(16, 12, 0.5f);
  EXPECT_REGRADE_ERROR(EdgeNetwork(networks.mean).EdgeMap(picture), ExitCode::kExternalProgram,
                       "mean.onnx");
  EXPECT_REGRADE_ERROR(EdgeNetwork(networks.edges + "x"), ExitCode::kExternalProgram,
                       "there is no such file");
}

TEST(EdgeNetwork, FramesWithOtherEdgesAreLessAlike) {
  const Networks networks;
  const Image picture = WaveImage(60, 40, 5, 1);
  Image grey = picture;
  for (int64_t p = 0; p < grey.num_pixels(); ++p)
    std::fill_n(&grey.pixels[3 * p], 3, grey.pixels[3 * p + 1]);
  ConsistencyOptions options{.edges = networks.edges};
  FidelityTargets targets;
  targets.unstyled = Frames({picture, picture});
  OpenNetworks(options, &targets);
  const FidelityRow same = MeasureFidelity({"same", Frames({picture, picture})}, targets),
                    other = MeasureFidelity({"grey", Frames({grey, picture})}, targets);
  EXPECT_NEAR(*same.edge_ssim, 1, 1e-9);
  EXPECT_LT(*other.edge_ssim, 0.999);
}

}  // namespace
}  // namespace regrade
