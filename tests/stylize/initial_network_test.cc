// Where learning a style starts: norms and spread of the initial weights.
#include "stylize/training/initial_network.h"

#include "tests/support/row_of_voxels.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

TEST(InitialNetwork, PyTorchStartHasItsWeightsNorms) {
  LipschitzNetwork network;
  InitializeAsPyTorch(3, &network);
  const DenseNetwork<double> f = network.Effective<double>();
  for (int l = 0; l < kNetworkLayers; ++l)
    for (const int i : {0, 5, 900})
      EXPECT_NEAR(f.layers[static_cast<size_t>(l)].weight[static_cast<size_t>(i)],
                  network.weight(l)[i], 1e-6);
}

// How far apart the voxels' coefficients are after the network, of how far they were.
TEST(InitialNetwork, PyTorchStartSendsVoxelsToOneColourAndOthersDoNot) {
  const RadianceField field = Ball(10);
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  const int64_t n = static_cast<int64_t>(vertex.size());
  const auto spread = [](const std::vector<float>& rows) {
    double sum = 0;
    const int64_t count = static_cast<int64_t>(rows.size()) / kFeatureStride;
    for (int k = 0; k < kNetworkSh; ++k) {
      double mean = 0, squares = 0;
      for (int64_t i = 0; i < count; ++i)
        mean += rows[static_cast<size_t>(i * kFeatureStride + k)];
      mean /= static_cast<double>(count);
      for (int64_t i = 0; i < count; ++i) {
        const double d = rows[static_cast<size_t>(i * kFeatureStride + k)] - mean;
        squares += d * d;
      }
      sum += squares;
    }
    return std::sqrt(sum);
  };
  std::vector<float> features(static_cast<size_t>(n * kFeatureStride)), out(features.size());
  for (int64_t i = 0; i < n; ++i)
    FillFeatures(field, 1, i, vertex[static_cast<size_t>(i)],
                 &features[static_cast<size_t>(i * kFeatureStride)]);
  const auto kept = [&](const char* start) {
    LipschitzNetwork network;
    InitializeWithoutMap(start, 3, &network);
    network.Forward(features.data(), n, out.data());
    return spread(out) / spread(features);
  };
  EXPECT_LT(kept("pytorch"), 0.1);
  EXPECT_GT(kept("orthogonal"), 0.2);
  EXPECT_GT(kept("identity"), 0.5);
}

// The products of norms for layers of 30 - 64 x 5 - 27: a uniform matrix of range r has a norm
// of about r / sqrt(3) (sqrt(rows) + sqrt(columns)).
TEST(InitialNetwork, SirenStartsHaveTheirProducts) {
  const auto product = [](const char* start) {
    LipschitzNetwork network;
    InitializeWithoutMap(start, 3, &network);
    double product = 1, expected = 1;
    for (int l = 0; l < kNetworkLayers; ++l) {
      const double inputs = network.Inputs(l), outputs = network.Outputs(l);
      float range = 0;
      for (int64_t i = 0; i < network.bias(l) - network.weight(l); ++i)
        range = std::max(range, std::abs(network.weight(l)[i]));
      product *= network.NormEstimate(l);
      expected *= range / std::sqrt(3.0) * (std::sqrt(inputs) + std::sqrt(outputs));
    }
    EXPECT_NEAR(product / expected, 1, 0.3) << start;  // six norms, each within a few percent
    return product;
  };
  EXPECT_NEAR(product("siren"), 32, 8);
  EXPECT_NEAR(product("siren-wide-end"), 970, 240);
  EXPECT_NEAR(product("siren-even"), 435, 110);
}

}  // namespace
}  // namespace regrade
