// Networks with one picture: what they get, which outputs count, and refused files; distances
// of a sequence to a style picture.
#include "evaluate/image_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evaluate/fidelity_networks.h"
#include "evaluate/style_distance.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using namespace regrade::testing;

// Frames and style may differ in size.
struct Networks {
  TemporaryFolder folder;
  std::string features = folder / "features.onnx", vector = folder / "vector.onnx",
              edges = folder / "edges.onnx";
  Networks() {
    WriteText(features, FeatureNetwork());
    WriteText(vector, EmbeddingNetwork());
    WriteText(edges, EdgeNetwork());
  }
};

TEST(ImageNetwork, EveryLastOutputCounts) {
  const Networks networks;
  const ImageNetwork network(networks.features);
  const auto dark = network.Features(ConstantImage(20, 10, 0.25f));
  const auto bright = network.Features(ConstantImage(14, 12, 0.5f));
  ASSERT_EQ(dark.size(), 2u);
  EXPECT_EQ(dark[0].channels(), 2);
  EXPECT_EQ(dark[0].count(), 200);
  EXPECT_EQ(dark[1].channels(), 1);
  // In the range -1 to 1: -0.5 and 0. Outputs: (r, g - b), and (2 r).
  EXPECT_NEAR(FrechetDistance(dark[0], bright[0]), 0.25, 1e-6);
  EXPECT_NEAR(FrechetDistance(dark[1], bright[1]), 1, 1e-6);
  EXPECT_NEAR(GramDistance(dark[1], bright[1]), 0.25, 1e-6);
}

TEST(ImageNetwork, AnEmbeddingIsOfTheWholePictureAtOneSize) {
  const Networks networks;
  const ImageNetwork network(networks.vector);
  Image halves(100, 40, 3);  // left red, right black
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 50; ++x) halves.at(x, y)[0] = 1;
  const std::vector<float> vector = network.Embedding(halves);
  ASSERT_EQ(vector.size(), 3u);
  EXPECT_NEAR(vector[0], 0, 1e-5);  // half of 1 and half of -1
  EXPECT_NEAR(vector[1], -1, 1e-5);
  EXPECT_NEAR(EmbeddingDistance(vector, vector), 0, 1e-12);
  EXPECT_NEAR(EmbeddingDistance({1, 0}, {0, 3}), 1, 1e-12);
  EXPECT_NEAR(EmbeddingDistance({1, 1}, {-2, -2}), 2, 1e-12);
  EXPECT_EQ(EmbeddingDistance({0, 0}, {1, 2}), 1);
  // Alpha is ignored, even where a picture is transparent.
  Image clear(100, 40, 4);
  for (int64_t p = 0; p < clear.num_pixels(); ++p) {
    std::copy_n(&halves.pixels[3 * p], 3, &clear.pixels[4 * p]);
    clear.pixels[4 * p + 3] = p % 3 == 0 ? 0 : 1;
  }
  EXPECT_EQ(network.Embedding(clear), vector);
}

TEST(ImageNetwork, RefusalsNameTheFile) {
  const Networks networks;
  const Image picture = ConstantImage(16, 12, 0.5f);
  EXPECT_REGRADE_ERROR(ImageNetwork(networks.vector).EdgeMap(picture),
                       ExitCode::kExternalProgram, "vector.onnx");
  EXPECT_REGRADE_ERROR(ImageNetwork(networks.edges + "x"), ExitCode::kExternalProgram,
                       "there is no such file");
  EXPECT_EQ(OpenImageNetwork(""), nullptr);
}

TEST(StyleDistance, FramesInTheStylesColoursAreCloser) {
  const Networks networks;
  const Image style = WaveImage(60, 40, 5, 1);
  Image grey = style;
  for (int64_t p = 0; p < grey.num_pixels(); ++p)
    std::fill_n(&grey.pixels[3 * p], 3, grey.pixels[3 * p + 1]);
  ConsistencyOptions options;
  options.style_features = networks.features;
  options.style_embedding = networks.vector;
  options.edges = networks.edges;
  FidelityTargets targets;
  targets.style = &style;
  targets.unstyled = Frames({style, style});
  OpenNetworks(options, &targets);
  const FidelityRow same = MeasureFidelity({"same", Frames({style, style})}, targets),
                    other = MeasureFidelity({"grey", Frames({grey, style})}, targets);
  EXPECT_NEAR(*same.gram_to_style, 0, 1e-12);
  EXPECT_NEAR(*same.frechet_to_style, 0, 1e-9);
  EXPECT_NEAR(*same.embedding_to_style, 0, 1e-6);  // of floats
  EXPECT_NEAR(*same.edge_ssim, 1, 1e-9);
  EXPECT_GT(*other.gram_to_style, 1e-5);
  EXPECT_GT(*other.frechet_to_style, 1e-4);
  EXPECT_GT(*other.embedding_to_style, 1e-5);
  EXPECT_LT(*other.edge_ssim, 0.999);
  EXPECT_FALSE(same.artfid_like);  // there is no LPIPS
  targets.perceptual = [](const Image& a, const Image& b) { return a.pixels[2] - b.pixels[2]; };
  const FidelityRow with_lpips = MeasureFidelity({"grey", Frames({grey, style})}, targets);
  const double lpips = (double{grey.pixels[2]} - style.pixels[2]) / 2;
  EXPECT_NEAR(*with_lpips.lpips_to_unstyled, lpips, 1e-9);
  EXPECT_NEAR(*with_lpips.artfid_like, (1 + lpips) * (1 + *other.frechet_to_style), 1e-9);
  // Without the style picture there is nothing to compare with.
  FidelityTargets none;
  OpenNetworks(options, &none);
  EXPECT_FALSE(none.style_features);
}

}  // namespace
}  // namespace regrade
