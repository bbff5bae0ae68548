// The fast path for splats on the CPU against the plain picture and its adjoint.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "kernels/splats/cpu/render_splats.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::Draw;
using testing::RandomSplats;
using testing::SplatCameraOf;

class FastSplats : public ::testing::TestWithParam<std::tuple<const char*, bool>> {
 protected:
  void SetUp() override {
    if (functions() == nullptr)
      GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
    options_.fit_pixel = std::get<1>(GetParam()) ? 0 : -1;
  }
  const SplatTileFunctions* functions() const { return SplatTilesFor(std::get<0>(GetParam())); }
  SplatOptions options_;
};

// Scenes in front of the camera and around it, of needles, and of splats that all end pixels.
std::vector<Splats> Scenes() {
  SplatArrays<double> needles = RandomSplats(300, 4, 91), opaque = RandomSplats(400, 1, 92);
  for (size_t i = 0; i < 300; ++i) needles.log_scale[3 * i] += 6;
  for (double& logit : opaque.opacity_logit) logit += 6;
  return {CastSplats<float>(RandomSplats(600, 16, 93)),
          CastSplats<float>(RandomSplats(600, 9, 94, 3.2)), CastSplats<float>(needles),
          CastSplats<float>(opaque), Splats(0, 1)};
}

// Where q is a rounding away from Q, or T from 1e-4, the paths may decide differently: then a
// pixel lacks a splat of alpha 1 / 255 or what is behind T = 1e-4.
TEST_P(FastSplats, RendersAsThePlainPicture) {
  const Camera camera = SplatCameraOf(75, 50);  // no multiple of a tile
  int otherwise = 0, pixels = 0;
  for (const Splats& splats : Scenes()) {
    const auto plain = RenderSplatsPlain(splats.view(), camera, options_);
    const auto fast =
        RenderSplats(MakeSplatFrame(splats.view(), camera, options_), *functions());
    for (size_t p = 0; p < plain.depth.size(); ++p) {
      double off = std::max(std::abs(fast.transmittance[p] - plain.transmittance[p]),
                            std::abs(fast.depth[p] - plain.depth[p]) / 8);
      for (size_t c = 3 * p; c < 3 * p + 3; ++c)
        off = std::max(off, std::abs(double{fast.color[c]} - plain.color[c]));
      ++pixels;
      if (off > 1e-5 || fast.median_depth[p] != plain.median_depth[p]) {
        ++otherwise;
        EXPECT_LE(off, 2 / 255.0);
      } else {
        testing::RecordBound("a pixel against the plain picture", testing::Computed::kFloat,
                             off, 1e-5);
      }
    }
  }
  EXPECT_LE(otherwise,
            testing::RecordBound("pixels decided otherwise", testing::Computed::kFloat,
                                 otherwise, pixels / 1000));
}

// All gradients against the plain adjoint of the same pictures in float; the two differ in the
// order of their sums, and in pixels that are decided otherwise.
TEST_P(FastSplats, GradientsAsThePlainAdjoint) {
  const Camera camera = SplatCameraOf(75, 50);
  SplatPicture<float> d(75, 50);
  uint64_t n = 0;
  for (std::vector<float>* values : {&d.color, &d.depth, &d.transmittance})
    for (float& value : *values) value = static_cast<float>(Draw(95, n++, 0, -1, 1));
  for (const Splats& splats : Scenes()) {
    const auto plain = RenderSplatsPlainAdjoint(splats.view(), camera, options_, d);
    const auto fast =
        RenderSplatsAdjoint(MakeSplatFrame(splats.view(), camera, options_), d, *functions());
    const auto check = [&](const char* what, const std::vector<float>& got,
                           const std::vector<float>& exact) {
      double largest = 0, sum = 0, square = 0;
      for (size_t i = 0; i < exact.size(); ++i) {
        largest = std::max(largest, std::abs(double{exact[i]}));
        square += exact[i] * double{exact[i]};
        sum += (got[i] - double{exact[i]}) * (got[i] - double{exact[i]});
      }
      const double error = std::sqrt(sum), norm = std::sqrt(square);
      EXPECT_LE(error, testing::RecordDigits(std::string("gradient by ") + what,
                                             testing::Computed::kFloat, error, 1e-5, norm))
          << what << ", largest " << largest;
    };
    check("means", fast.mean, plain.mean);
    check("scales", fast.log_scale, plain.log_scale);
    check("quaternions", fast.quaternion, plain.quaternion);
    check("opacities", fast.opacity_logit, plain.opacity_logit);
    check("colours", fast.sh, plain.sh);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(fast.background[c], plain.background[c],
                  1e-4 * (1 + std::abs(plain.background[c])));
  }
}

TEST_P(FastSplats, AnyNumberOfThreadsGivesTheSameBits) {
  const Camera camera = SplatCameraOf(75, 50);
  const Splats splats = CastSplats<float>(RandomSplats(600, 4, 96));
  SplatPicture<float> d(75, 50);
  for (size_t i = 0; i < d.color.size(); ++i)
    d.color[i] = static_cast<float>(Draw(97, i, 0, -1, 1));
  std::vector<float> color, mean, sh;
  for (const int threads : {1, 2, 5}) {
    const testing::Threads use(threads);
    const SplatFrame frame = MakeSplatFrame(splats.view(), camera, options_);
    const auto picture = RenderSplats(frame, *functions());
    const auto gradient = RenderSplatsAdjoint(frame, d, *functions());
    if (threads == 1) color = picture.color, mean = gradient.mean, sh = gradient.sh;
    EXPECT_TRUE(testing::RecordSameBits(
        "picture and gradient", testing::Computed::kFloat,
        color == picture.color && mean == gradient.mean && sh == gradient.sh));
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, FastSplats,
                         ::testing::Combine(::testing::Values("baseline", "avx2", "avx512"),
                                            ::testing::Bool()));

}  // namespace
}  // namespace regrade
