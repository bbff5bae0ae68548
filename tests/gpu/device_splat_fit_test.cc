// Fits of splats on the device against those on the CPU; skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/image/cuda/device_picture_loss.h"
#include "kernels/image/picture_loss.h"
#include "kernels/splats/cuda/device_seen_depth.h"
#include "kernels/splats/cuda/device_splat_update.h"
#include "reconstruct/splats/fit_splats.h"
#include "reconstruct/splats/splat_engine.h"
#include "tests/support/ball_views.h"
#include "tests/support/device_test.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

class DeviceSplatFit : public testing::SkippedWithoutGpu<testing::FitField> {
 protected:
  void SetUp() override {
    testing::SkippedWithoutGpu<testing::FitField>::SetUp();
    if (IsSkipped()) return;
    FitField::SetUp();
    box_.background = truth_.background;
    fit_.thousands = 2;
    fit_.sh_degree = 1;
  }
  SplatFitOptions fit_;
};

TEST_F(DeviceSplatFit, LossIsThatOfTheHost) {
  constexpr int kWidth = 53, kHeight = 41;
  constexpr int64_t kPixels = int64_t{kWidth} * kHeight;
  std::vector<uint16_t> photo(3 * kPixels);
  std::vector<uint8_t> masked(kPixels);
  std::vector<float> picture(photo.size()), expected(photo.size()), d(photo.size());
  for (size_t i = 0; i < photo.size(); ++i) {
    photo[i] = static_cast<uint16_t>(RandomDouble(1, 2, i) * 65535);
    picture[i] = static_cast<float>(photo[i] / 65535.0 + 0.2 * (RandomDouble(1, 3, i) - 0.5));
  }
  for (size_t p = 0; p < masked.size(); p += 97) masked[p] = 1;
  LossRows rows;
  const PictureSums host = Compare(kWidth, kHeight, photo.data(), masked.data(), picture.data(),
                                   0.2f, &rows, expected.data());
  DeviceBuffer<uint16_t> photo_there(3 * kPixels, "photo");
  DeviceBuffer<uint8_t> masked_there(kPixels, "mask");
  DeviceBuffer<float> picture_there(3 * kPixels, "picture"), d_there(3 * kPixels, "gradient");
  photo_there.CopyIn(photo.data(), 3 * kPixels);
  masked_there.CopyIn(masked.data(), kPixels);
  picture_there.CopyIn(picture.data(), 3 * kPixels);
  DevicePictureLoss loss;
  loss.Compare(kWidth, kHeight, photo_there.data(), masked_there.data(), picture_there.data(),
               0.2f, d_there.data());
  const PictureSums sums = loss.TakeSums();
  d_there.CopyOut(d.data(), 3 * kPixels);
  EXPECT_EQ(sums.values, host.values);
  EXPECT_NEAR(sums.absolute, host.absolute, 1e-5 * host.absolute);
  EXPECT_NEAR(sums.squared, host.squared, 1e-5 * host.squared);
  EXPECT_NEAR(sums.similarity, host.similarity, 1e-4 * host.similarity);
  double square = 0, error = 0;
  for (size_t i = 0; i < d.size(); ++i) {
    square += double{expected[i]} * expected[i];
    error += std::pow(double{d[i]} - expected[i], 2);
  }
  EXPECT_LT(std::sqrt(error / square), 2e-4);
  EXPECT_EQ(loss.TakeSums().values, 0);
}

TEST_F(DeviceSplatFit, DepthGradientIsThatOfTheHost) {
  constexpr int kPixels = 1000, kSeen = 300;
  std::vector<float> z(kPixels), transmittance(kPixels), d_z(kPixels), d_t(kPixels);
  for (size_t i = 0; i < z.size(); ++i) {
    z[i] = static_cast<float>(4 * RandomDouble(2, 1, i));
    transmittance[i] = static_cast<float>(0.1 * RandomDouble(2, 2, i));
  }
  std::vector<SeenDepth> seen;
  for (int i = 0; i < kSeen; ++i)
    seen.push_back({3 * i, 2 + static_cast<float>(i % 7) * 0.1f, 0.02f * (1 + i % 20)});
  for (const SeenDepth& one : seen)
    WriteDepthGradient(one, kSeen, 0.03f, {z.data(), transmittance.data()},
                       {d_z.data(), d_t.data()});
  DeviceBuffer<SeenDepth> seen_there(kSeen, "depths");
  DeviceBuffer<float> z_there(kPixels, "z"), transmittance_there(kPixels, "T"),
      d_z_there(kPixels, "d_z"), d_t_there(kPixels, "d_T");
  seen_there.CopyIn(seen.data(), kSeen);
  z_there.CopyIn(z.data(), kPixels);
  transmittance_there.CopyIn(transmittance.data(), kPixels);
  d_z_there.Zero();
  d_t_there.Zero();
  WriteDepthGradientOnDevice(seen_there.data(), kSeen, 0.03f,
                             {z_there.data(), transmittance_there.data()},
                             {d_z_there.data(), d_t_there.data()});
  std::vector<float> z_back(kPixels), t_back(kPixels);
  d_z_there.CopyOut(z_back.data(), kPixels);
  d_t_there.CopyOut(t_back.data(), kPixels);
  for (size_t i = 0; i < z.size(); ++i) {
    EXPECT_NEAR(z_back[i], d_z[i], 1e-5f * std::abs(d_z[i]) + 1e-9f) << i;
    EXPECT_NEAR(t_back[i], d_t[i], 1e-5f * std::abs(d_t[i]) + 1e-9f) << i;
  }
}

TEST_F(DeviceSplatFit, PopulationChangesAsOnTheHost) {
  Splats host = testing::CastSplats<float>(testing::RandomSplats(100, 4, 3));
  PopulationChange change;
  change.count = 103;
  change.copied = {{7, -1.5f, -0.25f}, {90, 0.5f, -0.5f}};
  change.copies = {{7, 12}, {7, 100}, {90, 101}, {90, 102}};
  DeviceSplatMoments device;
  for (DeviceSplats* of : {&device.value, &device.first, &device.second}) of->Upload(host);
  ApplyChangeOnDevice(change, &device);
  Splats moment = host;
  ApplyChange(change, false, &host);
  ApplyChange(change, true, &moment);
  const auto expect_same = [](const Splats& a, const Splats& b) {
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.log_scale, b.log_scale);
    EXPECT_EQ(a.quaternion, b.quaternion);
    EXPECT_EQ(a.opacity_logit, b.opacity_logit);
    EXPECT_EQ(a.sh, b.sh);
  };
  expect_same(device.value.Download(), host);
  expect_same(device.first.Download(), moment);
}

// Adam divides by the gradient's size, so that a gradient of rounding errors alone, of a splat
// that hardly counts, may go either way: most values agree, and pictures do.
TEST_F(DeviceSplatFit, StepsAreThoseOfTheHost) {
  fit_.steps = 15;
  for (TrainingView& view : views_) {  // the ball's point that is nearest to the camera
    const Vec3d center = view.camera.Center();
    view.points.push_back({(center * (0.55 / Norm(center))).Cast<float>(), 0.01f});
  }
  for (const int degree : {1, 3}) {
    fit_.sh_degree = degree;
    std::vector<Image> pictures;
    SplatFitHooks hooks;
    hooks.measure = [&](SplatEngine* engine) {
      pictures.push_back(engine->Render(cameras_[0]).color);
    };
    const Splats host = FitSplats(views_, box_, fit_, hooks, Backend::kCpu).splats;
    const Splats device = FitSplats(views_, box_, fit_, hooks, Backend::kCuda).splats;
    EXPECT_EQ(device.count(), host.count());
    EXPECT_EQ(device.basis, host.basis);
    EXPECT_GT(DecibelsBetween(pictures[1], pictures[0]), 35) << degree;
  }
}

TEST_F(DeviceSplatFit, ReproducesAHeldOutViewWithTheSameBitsEachTime) {
  fit_.steps = 400;
  std::vector<double> psnr;
  SplatFitHooks hooks;
  hooks.measure = [&](SplatEngine* engine) {
    psnr.push_back(DecibelsBetween(engine->Render(cameras_[0]).color, photos_[0]));
  };
  const Splats once = FitSplats(views_, box_, fit_, hooks, Backend::kCuda).splats;
  const Splats again = FitSplats(views_, box_, fit_, hooks, Backend::kCuda).splats;
  EXPECT_EQ(once.mean, again.mean);
  EXPECT_EQ(once.sh, again.sh);
  Image background(48, 48);
  for (size_t i = 0; i < background.pixels.size(); ++i)
    background.pixels[i] = truth_.background[static_cast<int>(i % 3)];
  EXPECT_GT(psnr[0], DecibelsBetween(background, photos_[0]) + 12);
}

TEST_F(DeviceSplatFit, FrozenSplatsKeepTheirBits) {
  fit_.steps = 100;
  const Splats start = FitSplats(views_, box_, fit_, {}, Backend::kCuda).splats;
  const int64_t frozen = start.count() / 2;
  SplatFitState state = RefinementOf(start, frozen);
  SplatFitHooks hooks;
  hooks.resume = &state;
  const Splats refined =
      RefineSplats(SplatPhotos(views_), {}, box_, fit_, hooks, Backend::kCuda).splats;
  const auto same = [frozen](const std::vector<float>& a, const std::vector<float>& b,
                             int64_t each) {
    return std::equal(a.begin(), a.begin() + each * frozen, b.begin());
  };
  ASSERT_EQ(refined.basis, start.basis);
  EXPECT_GT(refined.count(), start.count());
  EXPECT_TRUE(same(start.mean, refined.mean, 3));
  EXPECT_TRUE(same(start.log_scale, refined.log_scale, 3));
  EXPECT_TRUE(same(start.quaternion, refined.quaternion, 4));
  EXPECT_TRUE(same(start.opacity_logit, refined.opacity_logit, 1));
  EXPECT_TRUE(same(start.sh, refined.sh, 3 * start.basis));
  EXPECT_NE(start.mean.back(), refined.mean[start.mean.size() - 1]);
}

}  // namespace
}  // namespace regrade
