// The parity table of style training: each device function against the plain specification in
// double, or against the CPU path that is tested with it. Every test is skipped without a
// device.
#include "stylize/cuda/device_style.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/device/device_memory.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/network/cuda/device_mlp.h"
#include "tests/support/device_test.h"
#include "tests/support/parity_row.h"
#include "tests/support/small_field.h"
#include "tests/support/splat_ball.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

using DeviceStyle = testing::DeviceTest;

DenseNetwork<double> InDouble(const DenseNetwork<float>& network) {
  DenseNetwork<double> exact;
  exact.activation = network.activation;
  exact.omega = network.omega;
  for (const DenseLayer<float>& layer : network.layers) {
    DenseLayer<double> wide(layer.outputs, layer.inputs);
    std::copy(layer.weight.begin(), layer.weight.end(), wide.weight.begin());
    std::copy(layer.bias.begin(), layer.bias.end(), wide.bias.begin());
    exact.layers.push_back(std::move(wide));
  }
  return exact;
}

// TF32 rounds each factor to 10 bits of mantissa: 5e-4 per factor, through six layers. Split
// factors are as accurate as floats, with the tolerances of the CPU's fast path.
struct Tolerances {
  MlpPrecision precision;
  const char* name;
  double forward, gradient;
};
constexpr Tolerances kTolerances[] = {{MlpPrecision::kTensor, "tf32", 6e-3, 6e-3},
                                      {MlpPrecision::kSplit, "split tf32", 1e-5, 1e-5}};

bool HasKink(const std::string& activation) {
  return activation == "relu" || activation == "leaky-relu";
}

// n rows through the network, forward and adjoint, for each activation and precision.
void CheckMlp(int64_t n, int basis) {
  const NetworkRow shape{basis};
  const int stride = shape.stride();
  for (const char* activation : {"sine", "relu", "leaky-relu", "sigmoid", "tanh"}) {
    LipschitzNetwork random = RandomNetwork(17, 1.3, basis);
    random.data().activation = activation;
    const DenseNetwork<float> network = random.Effective<float>();
    const DenseNetwork<double> exact = InDouble(network);
    Buffer<float> input(n * stride), d_output(input.size());
    for (int64_t i = 0; i < input.size(); ++i) {
      const int64_t lane = i % stride;
      if (lane < shape.inputs())
        input[i] = static_cast<float>(Random(60, static_cast<uint64_t>(i)));
      if (lane < shape.sh())
        d_output[i] = static_cast<float>(Random(61, static_cast<uint64_t>(i)));
    }
    const DeviceBuffer<float> x = DeviceBuffer<float>::Of(input, "input"),
                              d_y = DeviceBuffer<float>::Of(d_output, "gradient");
    DenseNetwork<double> expected;
    for (int l = 0; l < kNetworkLayers; ++l)
      expected.layers.emplace_back(random.Outputs(l), random.Inputs(l));
    std::vector<double> outputs(static_cast<size_t>(n * shape.sh()));
    for (int64_t r = 0; r < n; ++r) {
      double row[kLargestRow.inputs()], d_row[kLargestRow.sh()];
      std::copy_n(&input[r * stride], shape.inputs(), row);
      std::copy_n(&d_output[r * stride], shape.sh(), d_row);
      DenseForward(exact, row, &outputs[static_cast<size_t>(r * shape.sh())]);
      DenseAdjoint(exact, row, d_row, &expected, static_cast<double*>(nullptr));
    }
    for (const Tolerances& tolerances : kTolerances) {
      DeviceMlp mlp(MakeFusedMlp(network));
      DeviceBuffer<float> y(n * stride, "output");
      mlp.Forward(tolerances.precision, x.data(), n, y.data());
      const Buffer<float> rows = y.ToHost();
      double off = 0, largest = 0;
      for (int64_t r = 0; r < n; ++r)
        for (int k = 0; k < shape.sh(); ++k) {
          const double value = outputs[static_cast<size_t>(r * shape.sh() + k)];
          off = std::max(off, std::abs(rows[r * stride + k] - value));
          largest = std::max(largest, std::abs(value));
        }
      const std::string what = std::string(activation) + ", " + std::to_string(n) +
                               " rows of " + std::to_string(stride) + ", " + tolerances.name;
      ParityRow("network forward", what, "double, of the largest", off / largest,
                tolerances.forward);

      mlp.AddAdjoint(tolerances.precision, x.data(), d_y.data(), n);
      // The derivative of a rectifier is discontinuous: a unit that rounding moves across the
      // kink has another derivative, and because the gradients of these random rows nearly
      // cancel, each such unit is visible.
      if (HasKink(activation) && (n > 100 || tolerances.precision == MlpPrecision::kTensor))
        continue;
      DenseNetwork<double> gradient;
      for (int l = 0; l < kNetworkLayers; ++l)
        gradient.layers.emplace_back(random.Outputs(l), random.Inputs(l));
      mlp.TakeGradient(&gradient);
      double gradient_off = 0;
      for (size_t l = 0; l < kNetworkLayers;
           ++l) {  // of the largest entry of a layer's weights, and of its biases
        for (const auto part : {&DenseLayer<double>::weight, &DenseLayer<double>::bias}) {
          double largest_entry = 0, off_entry = 0;
          const std::vector<double>&is = gradient.layers[l].*part,
                &should = expected.layers[l].*part;
          for (size_t i = 0; i < should.size(); ++i) {
            largest_entry = std::max(largest_entry, std::abs(should[i]));
            off_entry = std::max(off_entry, std::abs(is[i] - should[i]));
          }
          gradient_off = std::max(gradient_off, off_entry / largest_entry);
        }
      }
      ParityRow("network gradient", what, "double, of a layer's largest", gradient_off,
                tolerances.gradient);
    }
  }
}

TEST_F(DeviceStyle, MlpLessThanATile) { CheckMlp(1, 9); }
TEST_F(DeviceStyle, MlpNoWholeTiles) { CheckMlp(37, 9); }
TEST_F(DeviceStyle, LargeMlpOfTwoChunks) { CheckMlp(70001, 9); }
TEST_F(DeviceStyle, WideMlpLessThanATile) { CheckMlp(1, 16); }
TEST_F(DeviceStyle, LargeWideMlpOfTwoChunks) { CheckMlp(70001, 16); }

enum class Scene { kBall, kBallBeforeLayers, kSplats };
constexpr const char* kSceneNames[] = {"", ", layers", ", splats"};

// Of splats the largest has degree 3.
std::vector<int> HarmonicsOf(Scene scene) {
  return scene == Scene::kSplats ? std::vector<int>{16, 9, 4, 1} : std::vector<int>{9, 4, 1};
}

// A ball of n voxels a side, one in front of background layers, or a ball of n^3 / 2 splats.
RadianceField FieldOf(Scene scene, int n, int basis) {
  if (scene == Scene::kSplats) return SplatBall(int64_t{n} * n * n / 2, 0.4f, basis);
  RadianceField field = Ball(n, basis);
  if (scene == Scene::kBallBeforeLayers) AddSpheres(40, 9, 0.7, 5, &field);
  return field;
}

// Loss, gradient and counts of the device path against the CPU's, which other tests compare
// with Algorithm 1 in double.
void CheckLossAndGradient(int side, Scene scene) {
  for (const int basis : HarmonicsOf(scene)) {
    const RadianceField field = FieldOf(scene, 14, basis);
    const DeviceStyleField on_card = UploadStyleField(field);
    LipschitzNetwork network = RandomNetwork(91, 1.3, RowOf(basis).basis);
    network.data().has_base = true;
    network.data().base = SomeMap();
    StyleRays batch = SomeRays(3, side);
    batch.targets[5].y = std::nanf("");
    for (const bool every_voxel : {false, true}) {
      const AggregationOptions options{.min_weight = 1e-4f,
                                       .max_transmittance = 0.9f,
                                       .one_sided = true,
                                       .view_weight = 0.7,
                                       .divide_by_voxels = every_voxel,
                                       .every_voxel = every_voxel,
                                       .batch = every_voxel ? 1 << 20 : 100};
      GradientAggregation on_cpu(field, options);
      const std::unique_ptr<StyleLoss> on_device = MakeDeviceStyleLoss(&on_card, options);
      const size_t size = static_cast<size_t>(network.NumParameters());
      std::vector<double> expected(size), gradient(size);
      const double should_be = on_cpu.Run(network, batch, nullptr).loss;
      const AggregationResult should = on_cpu.Run(network, batch, &expected);
      const AggregationResult exact = on_device->Run(network, batch, nullptr);
      const AggregationResult is = on_device->Run(network, batch, &gradient);
      const std::string what = "basis " + std::to_string(basis) + ", " +
                               std::to_string(batch.rays.size()) + " rays" +
                               kSceneNames[static_cast<int>(scene)];
      EXPECT_EQ(is.rays, should.rays);
      EXPECT_NEAR(static_cast<double>(is.samples), static_cast<double>(should.samples),
                  3);  // at the threshold
      EXPECT_NEAR(static_cast<double>(is.touched_voxels),
                  static_cast<double>(should.touched_voxels), 8);
      ParityRow("style loss", what, "CPU, relative",
                std::abs(exact.loss - should_be) / should_be, 2e-5);
      ParityRow("style loss, tf32", what, "CPU, relative",
                std::abs(is.loss - should.loss) / should.loss, 2e-3);
      ParityRow("style gradient, tf32", what, "CPU, norms",
                RelativeDifference(gradient, expected), 5e-3);
    }
  }
}

TEST_F(DeviceStyle, LossAndGradient) { CheckLossAndGradient(13, Scene::kBall); }
TEST_F(DeviceStyle, LossAndGradientBeforeLayers) {
  CheckLossAndGradient(13, Scene::kBallBeforeLayers);
}
TEST_F(DeviceStyle, LossAndGradientOfSplats) { CheckLossAndGradient(13, Scene::kSplats); }
TEST_F(DeviceStyle, LargeLossAndGradientOfTwoBandsOfSplats) {
  CheckLossAndGradient(150, Scene::kSplats);
}
TEST_F(DeviceStyle, LargeLossAndGradientOfTwoBands) { CheckLossAndGradient(150, Scene::kBall); }
TEST_F(DeviceStyle, LargeLossAndGradientOfTwoBandsBeforeLayers) {
  CheckLossAndGradient(150, Scene::kBallBeforeLayers);
}

// With the rays in the opposite order samples arrive in another one, and the bands hold others.
// Against float sums: TF32 rounds some factors whose last bit differs to the other side, by
// 1e-3 each, and few do.
void CheckExactSums(int side, Scene scene, int basis = 9) {
  const RadianceField field = FieldOf(scene, 40, basis);
  const DeviceStyleField on_card = UploadStyleField(field);
  const LipschitzNetwork network = RandomNetwork(33, 1.3, RowOf(basis).basis);
  StyleRays batch = SomeRays(3, side);
  struct Run {
    AggregationResult result;
    std::vector<double> gradient;
    StyleLoss::HiddenSums sums;
  };
  Run runs[3];
  for (Run& run : runs) {
    const AggregationOptions options{
        .min_weight = 1e-4f, .view_weight = 0.7, .exact_sums = &run != &runs[2]};
    const std::unique_ptr<StyleLoss> loss = MakeDeviceStyleLoss(&on_card, options);
    run.gradient.resize(static_cast<size_t>(network.NumParameters()));
    run.result = loss->Run(network, batch, &run.gradient);
    run.sums = loss->SumHidden(network, batch);
    std::reverse(batch.rays.begin(), batch.rays.end());
    std::reverse(batch.places.begin(), batch.places.end());
    std::reverse(batch.targets.begin(), batch.targets.end());
  }
  const auto& [one, other, floats] = runs;
  EXPECT_TRUE(RecordSameBits("gradients of rays in two orders", Computed::kGpu,
                             one.gradient == other.gradient));
  EXPECT_EQ(one.result.loss, other.result.loss);
  EXPECT_EQ(one.result.squared_error, other.result.squared_error);
  const size_t n = batch.rays.size();
  ASSERT_EQ(one.sums.hidden.size(), n * kMlpHidden);
  for (size_t r = 0; r < n; ++r) {
    for (size_t c = 0; c < 3; ++c)
      ASSERT_EQ(one.sums.missing[3 * r + c], other.sums.missing[3 * (n - 1 - r) + c]);
    for (size_t h = 0; h < kMlpHidden; ++h)
      ASSERT_EQ(one.sums.hidden[kMlpHidden * r + h],
                other.sums.hidden[kMlpHidden * (n - 1 - r) + h]);
  }
  ParityRow("exact sums of the style",
            std::to_string(n) + " rays" + kSceneNames[static_cast<int>(scene)],
            "float sums, norms", RelativeDifference(one.gradient, floats.gradient), 1e-4);
}

TEST_F(DeviceStyle, H68_ExactSumsAreTheSameBitsInAnyOrder) { CheckExactSums(50, Scene::kBall); }
TEST_F(DeviceStyle, H68_ExactSumsOfSplatsAreTheSameBitsInAnyOrder) {
  CheckExactSums(50, Scene::kSplats);
  CheckExactSums(50, Scene::kSplats, 16);
}
TEST_F(DeviceStyle, H68_LargeExactSumsAreTheSameBitsInAnyOrder) {
  CheckExactSums(150, Scene::kBallBeforeLayers);
}

void CheckHiddenSums(Scene scene, int basis = 9) {
  const RadianceField field = FieldOf(scene, 12, basis);
  const DeviceStyleField on_card = UploadStyleField(field);
  const StyleRays batch = SomeRays(2, 20);
  const LipschitzNetwork network = RandomNetwork(33, 1.3, RowOf(basis).basis);
  const AggregationOptions options{.max_transmittance = 0.5f};
  const auto should = GradientAggregation(field, options).SumHidden(network, batch);
  const auto is = MakeDeviceStyleLoss(&on_card, options)->SumHidden(network, batch);
  ASSERT_EQ(is.hidden.size(), should.hidden.size());
  ASSERT_EQ(is.missing.size(), should.missing.size());
  double off = 0;
  for (size_t i = 0; i < is.hidden.size(); ++i)
    off = std::max(off, std::abs(double{is.hidden[i]} - should.hidden[i]));
  for (size_t i = 0; i < is.missing.size(); ++i)
    off = std::max(off, std::abs(double{is.missing[i]} - should.missing[i]));
  ParityRow("hidden sums",
            "basis " + std::to_string(basis) + kSceneNames[static_cast<int>(scene)], "CPU", off,
            5e-5);
}

TEST_F(DeviceStyle, HiddenSums) { CheckHiddenSums(Scene::kBall); }
TEST_F(DeviceStyle, HiddenSumsBeforeLayers) { CheckHiddenSums(Scene::kBallBeforeLayers); }
TEST_F(DeviceStyle, HiddenSumsOfSplats) {
  CheckHiddenSums(Scene::kSplats);
  CheckHiddenSums(Scene::kSplats, 16);
}

void CheckRestyle(Scene scene) {
  for (const int basis : HarmonicsOf(scene)) {
    const std::string what =
        "basis " + std::to_string(basis) + kSceneNames[static_cast<int>(scene)];
    const RadianceField field = FieldOf(scene, 13, basis);
    LipschitzNetwork network = RandomNetwork(92, 1.3, RowOf(basis).basis);
    network.data().has_base = true;
    network.data().base = SomeMap();
    DeviceStyleField on_card = UploadStyleField(field);
    RestyleOnDevice(network, &on_card);
    // A card's field keeps its own harmonics.
    const Appearance is = DownloadAppearance(on_card),
                     should = LimitShBasis(ApplyNetwork(network, field), basis);
    ASSERT_EQ(is.sh.size(), should.sh.size());
    double off = 0;
    for (int64_t i = 0; i < is.sh.size(); ++i)
      off = std::max(off, std::abs(double{is.sh[i]} - should.sh[i]));
    ParityRow("restyled records", what, "CPU", off, 2e-5);
    ASSERT_EQ(is.sphere_color.size(), should.sphere_color.size());
    double layers_off = 0;
    for (int64_t i = 0; i < is.sphere_color.size(); ++i)
      layers_off =
          std::max(layers_off, std::abs(double{is.sphere_color[i]} - should.sphere_color[i]));
    ParityRow("restyled layers", what, "CPU", layers_off, 2e-5);
    if (scene == Scene::kSplats) continue;
    const RadianceField restyled = ToRadianceField(DownloadGrid(on_card.grid));
    ASSERT_TRUE(std::ranges::equal(restyled.geometry->density, field.geometry->density));
    ASSERT_TRUE(std::ranges::equal(restyled.geometry->spheres.density,
                                   field.geometry->spheres.density));
  }
}

TEST_F(DeviceStyle, Restyle) { CheckRestyle(Scene::kBallBeforeLayers); }
TEST_F(DeviceStyle, RestyleOfSplats) { CheckRestyle(Scene::kSplats); }

}  // namespace
}  // namespace regrade
