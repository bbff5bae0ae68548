// Training steps that run on the device without the host, against the same steps made one by
// one from the host. Without a device each test skips and says so.
#include "stylize/cuda/device_training.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stylize/cuda/device_style.h"
#include "stylize/training/host_steps.h"
#include "stylize/training/restyle_field.h"
#include "tests/support/device_test.h"
#include "tests/support/parity_row.h"
#include "tests/support/small_field.h"
#include "tests/support/splat_ball.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

class DeviceStyleTraining : public testing::DeviceTest {
 protected:
  static LipschitzNetwork Start() {
    LipschitzNetwork network = RandomNetwork(33);
    network.data().sh_scale = 2;
    network.data().has_base = true;
    network.data().base = SomeMap();
    network.WarmUpNorms();
    return network;
  }
  static WeightUpdate Update(int steps) {
    return {.options = {.steps = steps,
                        .rate_first = 1e-3,
                        .rate_last = 1e-4,
                        .lambda = 2e-2,
                        .norm_steps = 3},
            .layer_target = 0.9};
  }
  static constexpr int kViews = 3, kSide = 13;
  static constexpr int64_t kRays = int64_t{kViews} * kSide * kSide;
  // The same rays with other targets each time.
  static std::vector<StyleRays> Batches(int n, int side = kSide) {
    std::vector<StyleRays> batches(static_cast<size_t>(n), SomeRays(kViews, side));
    for (size_t i = 0; i < batches.size(); ++i)
      std::rotate(batches[i].targets.begin(),
                  batches[i].targets.begin() + static_cast<int64_t>(37 * i),
                  batches[i].targets.end());
    return batches;
  }
  static AggregationOptions Options(bool exact_sums = false) {
    return {.min_weight = 1e-4f,
            .max_transmittance = 0.9f,
            .one_sided = true,
            .view_weight = 0.5,
            .exact_sums = exact_sums};
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
  static void CheckSteps(const RadianceField& field, const char* name);
  static void CheckBuffers(const RadianceField& field);
  // Of the way that weights went, which is what is compared of two trainings: Adam divides a
  // gradient by its own size, so where a gradient is little more than rounding the two ways may
  // step to opposite sides.
  static constexpr double kOff = 5e-2;
};

void DeviceStyleTraining::CheckSteps(const RadianceField& field, const char* name) {
  const DeviceStyleField on_card = UploadStyleField(field);
  const std::unique_ptr<StyleLoss> loss = MakeDeviceStyleLoss(&on_card, Options());
  for (const double limit : {std::numeric_limits<double>::infinity(), 1e-3}) {
    for (const int steps : {1, 12}) {
      WeightUpdate update = Update(12);
      update.bound_limit = limit;
      const std::vector<StyleRays> batches = Batches(steps);
      LipschitzNetwork by_host = Start(), by_device = Start();
      const LipschitzNetwork start = Start();
      AdamState host_adam, device_adam;
      AggregationResult host_result;
      HostSteps from_host;
      for (int i = 0; i < steps; ++i)
        host_result =
            from_host
                .Make(update, {.first = i, .batches = {batches[static_cast<size_t>(i)]}},
                      loss.get(), &by_host, &host_adam)
                .last;
      ASSERT_EQ(host_adam.steps, steps);
      DeviceTraining training(&on_card, Options(), update, by_device, kRays, 12);
      training.Begin(0, batches, by_device, device_adam);
      const DeviceTraining::Steps made = training.End(&by_device, &device_adam);
      EXPECT_EQ(made.made, steps);
      EXPECT_FALSE(made.stopped);
      EXPECT_EQ(made.last.rays, host_result.rays);
      EXPECT_EQ(made.last.samples, host_result.samples);
      EXPECT_EQ(made.last.touched_voxels, host_result.touched_voxels);
      EXPECT_EQ(device_adam.steps, host_adam.steps);
      const std::string what = std::to_string(steps) + " steps" + name;
      ParityRow("training, last loss", what, "steps from the host, relative",
                std::abs(made.last.loss - host_result.loss) / host_result.loss, 1e-4);
      ParityRow("training, first moments", what, "steps from the host, norms",
                Difference(device_adam.first_moment, host_adam.first_moment,
                           std::vector<float>(device_adam.first_moment.size())),
                2e-3);
      ParityRow("training, weights", what, "steps from the host, of the path length",
                Difference(by_device.data().parameters, by_host.data().parameters,
                           start.data().parameters),
                kOff);
    }
  }
}

TEST_F(DeviceStyleTraining, StepsAreThoseOfTheHost) {
  RadianceField field = Ball(14, 9);
  AddSpheres(40, 9, 0.7, 5, &field);
  CheckSteps(field, "");
}
TEST_F(DeviceStyleTraining, StepsOnSplatsAreThoseOfTheHost) {
  CheckSteps(SplatBall(1500, 0.4f), ", splats");
}

void DeviceStyleTraining::CheckBuffers(const RadianceField& field) {
  const DeviceStyleField on_card = UploadStyleField(field);
  const std::vector<StyleRays> batches = Batches(5);
  double loss[2];
  for (const bool little : {false, true}) {
    LipschitzNetwork network = Start();
    AdamState adam;
    DeviceTraining training(&on_card, Options(), Update(5), network, kRays, 5);
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

TEST_F(DeviceStyleTraining, BuffersGrowAndNoStepIsLost) { CheckBuffers(Ball(14, 9)); }
TEST_F(DeviceStyleTraining, BuffersGrowAndNoStepOnSplatsIsLost) {
  CheckBuffers(SplatBall(1500, 0.4f));
}

// From photos to styled splats. Where the weights have gone another way by kOff of its length,
// the loss is another one by that part of what the way gained: its gradient times the way.
TEST_F(DeviceStyleTraining, SplatsAreRestyledAsOnTheCpu) {
  const StyledSplats ball(800, 6, 40, CurvedStyle);
  TrainingTargets targets;
  for (size_t v = 0; v < ball.views.size(); ++v)
    targets.Add(ball.views[v], ball.photos[v], ball.targets[v], ball.masks[v]);
  double loss[2] = {}, of_map[2] = {};
  RestyledField restyled[2];
  for (const bool on_card : {false, true}) {
    RestyleRequest request{.backend = on_card ? Backend::kCuda : Backend::kCpu};
    request.options.steps = 50;
    request.options.rays_per_step = 512;
    restyled[on_card] = Restyle(ball.field, targets, request, {});
    const TrainNetworkResult& trained = restyled[on_card].trained;
    EXPECT_EQ(trained.steps, 50);
    loss[on_card] = std::pow(10, -trained.psnr_db / 10);
    of_map[on_card] = std::pow(10, -trained.linear_map_psnr_db / 10);
  }
  ParityRow("map of splats", "800 splats", "CPU, relative", std::abs(of_map[1] / of_map[0] - 1),
            2e-5);
  ASSERT_LT(loss[0], 0.8 * of_map[0]);
  ParityRow("training of splats, loss", "50 steps", "CPU, of what was gained",
            std::abs(loss[1] - loss[0]) / (of_map[0] - loss[0]), kOff);
  const Buffer<float>&is = restyled[1].styled.appearance.sh,
        &should = restyled[0].styled.appearance.sh, &was = restyled[0].source.appearance.sh;
  const auto values = [](const Buffer<float>& sh) {
    return std::vector<float>(sh.begin(), sh.end());
  };
  ParityRow("splats restyled by a training", "50 steps", "CPU, of the change",
            Difference(values(is), values(should), values(was)), kOff);
}

// Exact sums: training again, with buffers that are too small at first, and in two parts as
// after an interruption gives the same bits. With float sums the runs differ in the last bits.
TEST_F(DeviceStyleTraining, H68_ExactSumsGiveTheSameBits) {
  constexpr int kSteps = 8, kLargeSide = 60;
  constexpr int64_t kLarge = int64_t{kViews} * kLargeSide * kLargeSide;
  RadianceField field = Ball(72, 9);
  AddSpheres(40, 24, 0.7, 5, &field);
  const DeviceStyleField on_card = UploadStyleField(field);
  const std::vector<StyleRays> batches = Batches(kSteps, kLargeSide);
  struct Trained {
    LipschitzNetwork network = Start();
    AdamState adam;
    DeviceTraining::Steps made;
  };
  const auto train = [&](bool exact, bool little, int parts) {
    Trained trained;
    for (int part = 0; part < parts; ++part) {
      DeviceTraining training(&on_card, Options(exact), Update(kSteps), trained.network, kLarge,
                              kSteps);
      if (little) training.ForgetCapacity(64, 32);
      const int size = kSteps / parts, first = part * size;
      training.Begin(first, {batches.begin() + first, batches.begin() + first + size},
                     trained.network, trained.adam);
      trained.made = training.End(&trained.network, &trained.adam);
      EXPECT_EQ(training.regrown() > 0, little);
    }
    EXPECT_EQ(trained.adam.steps, kSteps);
    return trained;
  };
  const Trained one = train(true, false, 1), floats = train(false, false, 1);
  EXPECT_GT(one.made.last.touched_voxels, 20000);
  struct Case {
    const char* name;
    Trained trained;
  };
  for (const auto& [name, other] :
       {Case{"again", train(true, false, 1)}, Case{"buffers that grow", train(true, true, 1)},
        Case{"in two parts", train(true, false, 2)}}) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(RecordSameBits(
        "networks of two trainings", Computed::kGpu,
        one.network.data().parameters == other.network.data().parameters &&
            one.network.data().singular_vectors == other.network.data().singular_vectors));
    EXPECT_EQ(one.adam.first_moment, other.adam.first_moment);
    EXPECT_EQ(one.adam.second_moment, other.adam.second_moment);
    EXPECT_EQ(one.made.last.loss, other.made.last.loss);
    EXPECT_EQ(one.made.last.squared_error, other.made.last.squared_error);
  }
  ParityRow("training with exact sums, weights", std::to_string(kSteps) + " steps",
            "float sums, of the path length",
            Difference(one.network.data().parameters, floats.network.data().parameters,
                       Start().data().parameters),
            kOff);
}

// A target that is not finite leaves the loss; weights that are not finite stop it, also where
// two calls share the two steps.
TEST_F(DeviceStyleTraining, TwoConsecutiveNonFiniteStepsStop) {
  const RadianceField field = Ball(14, 9);
  const DeviceStyleField on_card = UploadStyleField(field);
  std::vector<StyleRays> batches = Batches(4);
  batches[1].targets[7].x = std::nanf("");
  batches[2].rays.resize(100);  // fewer are filled up
  batches[2].targets.resize(100);
  LipschitzNetwork network = Start();
  AdamState adam;
  DeviceTraining training(&on_card, Options(), Update(40), network, kRays, 4);
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
  EXPECT_EQ(network.weight(0)[0], finite[0]);  // nothing has moved
}

}  // namespace
}  // namespace regrade
