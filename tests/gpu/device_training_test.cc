// Captured training steps on the device against the same steps issued one by one from the host.
// Every test is skipped without a device.
#include "stylize/cuda/device_training.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/network/lipschitz_layer.h"
#include "kernels/optimize/schedule.h"
#include "stylize/cuda/device_style.h"
#include "stylize/training/initial_network.h"
#include "stylize/training/lipschitz_regularizer.h"
#include "tests/support/parity_row.h"
#include "tests/support/small_field.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

class DeviceStyleTraining : public ::testing::Test {
 protected:
  void SetUp() override {
    const DeviceStatus status = ReadDeviceStatus();
    if (!status.found) GTEST_SKIP() << "no GPU: " << status.name;
  }

  static LipschitzNetwork Start() {
    LipschitzNetwork network = RandomNetwork(33);
    network.data().sh_scale = 2;
    network.data().has_base = true;
    network.data().base = SomeMap();
    network.WarmUpNorms();
    return network;
  }
  static LipschitzRule Rule(int64_t steps) {
    return {.steps = steps,
            .rate_first = 1e-3,
            .rate_last = 1e-4,
            .norm_steps = 3,
            .lambda = 2e-2,
            .layer_target = 0.9,
            .product_limit = std::numeric_limits<double>::infinity(),
            .input_scale = 2,
            .scaled_inputs = kNetworkSh};
  }
  static constexpr int kViews = 3, kSide = 13;
  static constexpr int64_t kRays = int64_t{kViews} * kSide * kSide;
  // The same rays with different targets each time.
  static std::vector<StyleRays> Batches(int n) {
    std::vector<StyleRays> batches(static_cast<size_t>(n), SomeRays(kViews, kSide));
    for (size_t i = 0; i < batches.size(); ++i)
      std::rotate(batches[i].targets.begin(),
                  batches[i].targets.begin() + static_cast<int64_t>(37 * i),
                  batches[i].targets.end());
    return batches;
  }
  static AggregationOptions Options() {
    return {
        .min_weight = 1e-4f, .max_transmittance = 0.9f, .one_sided = true, .view_weight = 0.5};
  }
  static double Difference(const std::vector<float>& a, const std::vector<float>& b,
                           const std::vector<float>& from) {
    double off = 0, moved = 0;
    for (size_t i = 0; i < a.size(); ++i) {
      off += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
      moved += (double{a[i]} - from[i]) * (double{a[i]} - from[i]);
    }
    return std::sqrt(off / moved);
  }
};

// One step of train_network.cc, with the loss of the device path.
bool StepFromHost(const LipschitzRule& rule, StyleLoss* loss, const StyleRays& batch,
                  int64_t step, LipschitzNetwork* network, AdamState* adam,
                  AggregationResult* result) {
  for (int i = 0; i < rule.norm_steps; ++i) network->StepNorms();
  std::vector<double> gradient(static_cast<size_t>(LipschitzNetwork::NumParameters()));
  *result = loss->Run(*network, batch, &gradient);
  for (int l = 0; l < kNetworkLayers; ++l)
    gradient[static_cast<size_t>(&network->k(l) - network->weight(0))] +=
        rule.lambda * LipschitzPenaltyDerivative(network->k(l), rule.layer_target);
  const std::vector<float> narrow(gradient.begin(), gradient.end());
  std::vector<float>& values = network->data().parameters;
  const int64_t size = static_cast<int64_t>(values.size());
  if (!AdamStep(rule.adam, CosineAnnealing(step, rule.steps, rule.rate_first, rule.rate_last),
                {narrow.data(), size}, {values.data(), size}, adam))
    return false;
  double product = 1;
  for (int l = 0; l < kNetworkLayers; ++l) product *= Squareplus<double>(network->k(l));
  if (product > rule.product_limit)
    for (int l = 0; l < kNetworkLayers; ++l)
      network->k(l) *=
          static_cast<float>(std::pow(rule.product_limit / product, 1.0 / kNetworkLayers));
  return true;
}

// Adam normalises a gradient by its magnitude, so a gradient close to rounding error may step
// in either direction: the comparison is of the total path of the weights.
TEST_F(DeviceStyleTraining, StepsAreThoseOfTheHost) {
  RadianceField field = Ball(14, 9);
  AddSpheres(40, 9, 0.7, 5, &field);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  const std::unique_ptr<StyleLoss> loss = MakeDeviceStyleLoss(&grid, Options());
  for (const double limit : {std::numeric_limits<double>::infinity(), 1e-3}) {
    for (const int steps : {1, 12}) {
      LipschitzRule rule = Rule(12);
      rule.product_limit = limit;
      const std::vector<StyleRays> batches = Batches(steps);
      LipschitzNetwork by_host = Start(), by_device = Start();
      const LipschitzNetwork start = Start();
      AdamState host_adam, device_adam;
      AggregationResult host_result;
      for (int i = 0; i < steps; ++i)
        ASSERT_TRUE(StepFromHost(rule, loss.get(), batches[static_cast<size_t>(i)], i, &by_host,
                                 &host_adam, &host_result));
      DeviceTraining training(&grid, Options(), rule, by_device, kRays, 12);
      training.Begin(0, batches, by_device, device_adam);
      const DeviceTraining::Steps made = training.End(&by_device, &device_adam);
      EXPECT_EQ(made.made, steps);
      EXPECT_FALSE(made.stopped);
      EXPECT_EQ(made.last.rays, host_result.rays);
      EXPECT_EQ(made.last.samples, host_result.samples);
      EXPECT_EQ(made.last.touched_voxels, host_result.touched_voxels);
      EXPECT_EQ(device_adam.steps, host_adam.steps);
      const std::string what = std::to_string(steps) + " steps";
      ParityRow("training, last loss", what, "steps from the host, relative",
                std::abs(made.last.loss - host_result.loss) / host_result.loss, 1e-4);
      ParityRow("training, first moments", what, "steps from the host, norms",
                Difference(device_adam.first_moment, host_adam.first_moment,
                           std::vector<float>(device_adam.first_moment.size())),
                2e-3);
      ParityRow("training, weights", what, "steps from the host, of the path length",
                Difference(by_device.data().parameters, by_host.data().parameters,
                           start.data().parameters),
                5e-2);
    }
  }
}

TEST_F(DeviceStyleTraining, BuffersGrowAndNoStepIsLost) {
  const RadianceField field = Ball(14, 9);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  const std::vector<StyleRays> batches = Batches(5);
  double loss[2];
  for (const bool little : {false, true}) {
    LipschitzNetwork network = Start();
    AdamState adam;
    DeviceTraining training(&grid, Options(), Rule(5), network, kRays, 5);
    if (little) training.ForgetCapacity(64, 32);
    training.Begin(0, batches, network, adam);
    const DeviceTraining::Steps made = training.End(&network, &adam);
    EXPECT_EQ(made.made, 5);
    EXPECT_EQ(adam.steps, 5);
    EXPECT_EQ(training.regrown() > 0, little);
    loss[little] = made.last.loss;
  }
  EXPECT_NEAR(loss[1] / loss[0], 1, 1e-4);
}

// A non-finite target is excluded from the loss; non-finite weights stop training, also if the
// two steps are in different calls.
TEST_F(DeviceStyleTraining, TwoConsecutiveNonFiniteStepsStop) {
  const RadianceField field = Ball(14, 9);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  std::vector<StyleRays> batches = Batches(4);
  batches[1].targets[7].x = std::nanf("");
  batches[2].rays.resize(100);  // a smaller batch is padded
  batches[2].targets.resize(100);
  LipschitzNetwork network = Start();
  AdamState adam;
  DeviceTraining training(&grid, Options(), Rule(40), network, kRays, 4);
  training.Begin(0, batches, network, adam);
  DeviceTraining::Steps made = training.End(&network, &adam);
  EXPECT_EQ(made.made, 4);
  EXPECT_EQ(adam.rejected, 0);
  for (const float value : network.data().parameters) ASSERT_TRUE(std::isfinite(value));
  const std::vector<float> finite = network.data().parameters;
  network.bias(2)[5] = std::nanf("");
  training.Begin(4, {batches[0]}, network, adam);
  made = training.End(&network, &adam);
  EXPECT_EQ(made.made, 1);
  EXPECT_FALSE(made.stopped);
  EXPECT_EQ(adam.rejected, 1);
  EXPECT_EQ(adam.steps, 4);
  training.Begin(5, Batches(3), network, adam);
  made = training.End(&network, &adam);
  EXPECT_TRUE(made.stopped);
  EXPECT_EQ(made.made, 1);
  EXPECT_EQ(adam.rejected, 2);
  EXPECT_EQ(made.gradient.size(), finite.size());
  EXPECT_EQ(network.weight(0)[0], finite[0]);  // unchanged
}

}  // namespace
}  // namespace regrade
