// Splats on the device against the fast path on the CPU, which has its own tests against the
// plain picture; skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "kernels/render/device_ray_weigher.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/cpu/render_splats.h"
#include "kernels/splats/cuda/device_splat_renderer.h"
#include "kernels/splats/splat_field.h"
#include "tests/support/device_test.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/splat_ball.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::Draw;
using testing::RandomSplats;
using testing::SplatCameraOf;

using DeviceSplatsTest = testing::DeviceTest;

struct Scene {
  std::string name;
  Splats splats;
};

// In front of the camera and around it, needles across many tiles, splats that all end pixels,
// a thousand at one depth, splats of which one covers the picture, and none.
std::vector<Scene> Scenes() {
  SplatArrays<double> needles = RandomSplats(300, 4, 91), opaque = RandomSplats(400, 1, 92);
  for (size_t i = 0; i < 300; ++i) needles.log_scale[3 * i + i % 3] += 6;
  for (double& logit : opaque.opacity_logit) logit += 6;
  SplatArrays<double> level = RandomSplats(1000, 4, 98, 1.2, 0.02);
  const Camera camera = SplatCameraOf(75, 50);
  const RigidTransform world = camera.camera_from_world.Inverse();
  for (int64_t i = 0; i < 1000; ++i) {
    Splat<double> splat = level.view()[i];
    splat.mean = world * Vec3d{splat.mean.x, splat.mean.y, 3.0};
    level.Set(i, splat);
  }
  SplatArrays<double> wide = RandomSplats(200, 9, 99);
  for (size_t i = 0; i < 40; ++i)
    for (size_t a = 0; a < 3; ++a) wide.log_scale[3 * i + a] += 3, wide.opacity_logit[i] = -3;
  std::vector<Scene> scenes;
  const auto add = [&](const char* name, const SplatArrays<double>& splats) {
    scenes.push_back({name, CastSplats<float>(splats)});
  };
  add("random", RandomSplats(600, 16, 93));
  add("around the camera", RandomSplats(600, 9, 94, 3.2));
  add("needles", needles);
  add("opaque", opaque);
  add("one depth", level);
  add("wide", wide);
  add("many", RandomSplats(20000, 4, 100, 1.2, 0.01));
  scenes.push_back({"none", Splats(0, 1)});
  scenes.back().splats.background = {0.3f, 0.6f, 0.2f};
  return scenes;
}

SplatPicture<float> RandomGradient(const Camera& camera) {
  SplatPicture<float> d(camera.width, camera.height);
  uint64_t n = 0;
  for (std::vector<float>* values : {&d.color, &d.depth, &d.transmittance})
    for (float& value : *values) value = static_cast<float>(Draw(95, n++, 0, -1, 1));
  return d;
}

// A picture's gradient in device memory.
struct DevicePixels {
  DeviceBuffer<float> color, depth, transmittance;
  explicit DevicePixels(const SplatPicture<float>& d)
      : color(static_cast<int64_t>(d.color.size()), "d_color"),
        depth(static_cast<int64_t>(d.depth.size()), "d_depth"),
        transmittance(static_cast<int64_t>(d.depth.size()), "d_transmittance") {
    color.CopyIn(d.color.data(), color.size());
    depth.CopyIn(d.depth.data(), depth.size());
    transmittance.CopyIn(d.transmittance.data(), transmittance.size());
  }
  SplatPixels<const float> all() const {
    return {color.data(), depth.data(), nullptr, transmittance.data()};
  }
  SplatPixels<const float> color_only() const { return {color.data()}; }
};

// |got - exact|; *norm: |exact|.
double Difference(const std::vector<float>& got, const std::vector<float>& exact,
                  double* norm) {
  double sum = 0, square = 0;
  for (size_t i = 0; i < exact.size(); ++i) {
    square += exact[i] * double{exact[i]};
    sum += (got[i] - double{exact[i]}) * (got[i] - double{exact[i]});
  }
  *norm = std::sqrt(square);
  return std::sqrt(sum);
}

// Both in float, with roundings that differ. As on the CPU, a pixel where q is a rounding away
// from Q, or T from 1e-4, may be decided otherwise.
TEST_F(DeviceSplatsTest, RendersAsTheCpu) {
  DeviceSplatRenderer renderer;
  DeviceSplats device;
  int otherwise = 0, pixels = 0;
  for (const Scene& scene : Scenes())
    for (const auto& [width, height] : {std::pair{75, 50}, {8, 8}, {1, 3}, {131, 97}})
      for (const bool antialiased : {false, true}) {
        SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
        const Camera camera = SplatCameraOf(width, height);
        const auto exact = RenderSplats(MakeSplatFrame(scene.splats.view(), camera, options));
        device.Upload(scene.splats);
        renderer.Render(device.view(), camera, options);
        const auto got = renderer.Download();
        for (size_t p = 0; p < exact.depth.size(); ++p) {
          double off = std::max(std::abs(got.transmittance[p] - exact.transmittance[p]),
                                std::abs(got.depth[p] - exact.depth[p]) / 8);
          for (size_t c = 3 * p; c < 3 * p + 3; ++c)
            off = std::max(off, std::abs(double{got.color[c]} - exact.color[c]));
          ++pixels;
          const double other_median = std::abs(got.median_depth[p] - exact.median_depth[p]);
          if (!(off <= 1e-5) || other_median > 1e-5) {
            ++otherwise;
            EXPECT_LE(off, 2 / 255.0) << scene.name << " " << width << " pixel " << p;
          } else {
            testing::RecordBound(scene.name + ": a pixel against the CPU",
                                 testing::Computed::kGpu, off, 1e-5);
          }
        }
      }
  EXPECT_LE(otherwise, testing::RecordBound("pixels decided otherwise", testing::Computed::kGpu,
                                            otherwise, pixels / 1000));
}

// By the norm of each kind of value; sums over a tile are in float on both sides, of other
// orders, and the device subtracts what is in front of a splat from a pixel's total and divides
// by 1 - alpha, which is at least 0.01: up to a hundred roundings, and ten for sums.
TEST_F(DeviceSplatsTest, GradientsAsOnTheCpu) {
  DeviceSplatRenderer renderer;
  DeviceSplats device, gradient;
  for (const Scene& scene : Scenes())
    for (const auto& [width, height] : {std::pair{75, 50}, {131, 97}})
      for (const bool antialiased : {false, true})
        for (const bool depth : {true, false}) {
          SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
          const Camera camera = SplatCameraOf(width, height);
          SplatPicture<float> d = RandomGradient(camera);
          if (!depth) std::fill(d.depth.begin(), d.depth.end(), 0.0f);
          if (!depth) std::fill(d.transmittance.begin(), d.transmittance.end(), 0.0f);
          const DevicePixels on_device(d);
          device.Upload(scene.splats);
          renderer.Render(device.view(), camera, options,
                          depth ? SplatPass::kAdjoint : SplatPass::kColorAdjoint);
          renderer.Adjoint(depth ? on_device.all() : on_device.color_only(), &gradient);
          const Splats got = gradient.Download();
          const SplatArrays<float> exact =
              RenderSplatsAdjoint(MakeSplatFrame(scene.splats.view(), camera, options), d);
          const auto check = [&](const char* what, const std::vector<float>& a,
                                 const std::vector<float>& b) {
            double norm = 0;
            const double error = Difference(a, b, &norm);
            EXPECT_LE(error, testing::RecordDigits(scene.name + ": gradient by " + what,
                                                   testing::Computed::kGpu, error, 1e-4, norm))
                << scene.name << " " << what << " " << width << " norm " << norm;
          };
          check("means", got.mean, exact.mean);
          check("scales", got.log_scale, exact.log_scale);
          check("quaternions", got.quaternion, exact.quaternion);
          check("opacities", got.opacity_logit, exact.opacity_logit);
          check("colours", got.sh, exact.sh);
          for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(got.background[c], exact.background[c],
                        1e-4 * (1 + std::abs(exact.background[c])));
        }
}

// More than 65536 tiles have keys of four bytes.
TEST_F(DeviceSplatsTest, LargePicturesAreRenderedAsOnTheCpu) {
  const Camera camera = SplatCameraOf(2113, 2101);
  const Splats splats = CastSplats<float>(RandomSplats(150, 1, 104));
  const auto exact = RenderSplats(MakeSplatFrame(splats.view(), camera, {}));
  DeviceSplats device;
  device.Upload(splats);
  DeviceSplatRenderer renderer;
  renderer.Render(device.view(), camera, {});
  double norm = 0;
  const double error = Difference(renderer.Download().color, exact.color, &norm);
  EXPECT_GT(norm, 0);
  // Pixels that are decided otherwise lack 1 / 255 each.
  EXPECT_LE(error, testing::RecordDigits("a large picture", testing::Computed::kGpu, error,
                                         1e-4, norm));
}

// Values that are not finite, too large or behind the camera are left out of the picture, and
// their gradients are 0.
TEST_F(DeviceSplatsTest, UnusableSplatsAreLeftOut) {
  const Camera camera = SplatCameraOf(75, 50);
  Splats splats = CastSplats<float>(RandomSplats(64, 16, 101));
  splats.mean[3] = NAN;
  splats.log_scale[3 * 2] = INFINITY;
  splats.quaternion[4 * 3 + 1] = NAN;
  splats.opacity_logit[4] = -INFINITY;
  splats.sh[48 * 5 + 47] = 2e6f;
  splats.sh[48 * 6 + 11] = NAN;
  DeviceSplats device, gradient;
  device.Upload(splats);
  DeviceSplatRenderer renderer;
  renderer.Render(device.view(), camera, {}, SplatPass::kAdjoint);
  const auto got = renderer.Download();
  const auto exact = RenderSplats(MakeSplatFrame(splats.view(), camera, {}));
  for (size_t i = 0; i < got.color.size(); ++i)
    ASSERT_NEAR(got.color[i], exact.color[i], 2 / 255.0);
  const DevicePixels d(RandomGradient(camera));
  renderer.Adjoint(d.all(), &gradient);
  const Splats by = gradient.Download();
  for (size_t i = 1; i <= 6; ++i) {
    EXPECT_EQ(by.opacity_logit[i], 0);
    for (size_t k = 48 * i; k < 48 * i + 48; ++k) EXPECT_EQ(by.sh[k], 0);
  }
  for (const float value : by.mean) EXPECT_TRUE(std::isfinite(value));
}

// Numbers of splats and sizes of pictures that grow and shrink, by one renderer, whose memory
// is used again; and again by a new one.
TEST_F(DeviceSplatsTest, AnyRunGivesTheSameBits) {
  DeviceSplatRenderer kept;
  DeviceSplats gradient;
  std::map<int, std::vector<float>> first;
  for (int round = 0; round < 3; ++round)
    for (const int count : {50, 4000, 30000, 700}) {
      const Camera camera = SplatCameraOf(count < 1000 ? 333 : 211, 97);
      DeviceSplats device;
      device.Upload(CastSplats<float>(RandomSplats(count, 4, 102)));
      const DevicePixels d(RandomGradient(camera));
      DeviceSplatRenderer fresh;
      DeviceSplatRenderer& renderer = round == 2 ? fresh : kept;
      renderer.Render(device.view(), camera, {}, SplatPass::kAdjoint);
      const auto picture = renderer.Download();
      renderer.Adjoint(d.all(), &gradient);
      const Splats by = gradient.Download();
      std::vector<float> all = picture.color;
      for (const auto* values : {&picture.depth, &picture.median_depth, &by.mean, &by.log_scale,
                                 &by.quaternion, &by.opacity_logit, &by.sh})
        all.insert(all.end(), values->begin(), values->end());
      for (int c = 0; c < 3; ++c) all.push_back(by.background[c]);
      if (round == 0) first[count] = all;
      EXPECT_TRUE(testing::RecordSameBits("picture and gradient", testing::Computed::kGpu,
                                          first[count] == all));
    }
}

// As films are rendered: a field and its styled copy, of which the host keeps no colours.
TEST_F(DeviceSplatsTest, AFieldAndItsStyleAreRenderedAsOnTheHost) {
  const GridFrame box{{}, {0, 0, 0}, {1, 1, 1}};
  const RadianceField field =
      FieldOfSplats(CastSplats<float>(RandomSplats(400, 9, 104)), box, 0.1f, -1);
  RadianceField styled = field;
  for (int64_t i = 0; i < styled.appearance.sh.size(); ++i) styled.appearance.sh[i] *= -0.5f;
  const Camera camera = SplatCameraOf(75, 50);
  const FieldRenderer host(field, Backend::kCpu), styled_host(styled, Backend::kCpu),
      device(field, Backend::kCuda), styled_device(styled, Backend::kCuda);
  const RenderedPair a = host.RenderWith(styled_host, camera),
                     b = device.RenderWith(styled_device, camera);
  for (size_t i = 0; i < a.view.color.pixels.size(); ++i) {
    ASSERT_NEAR(a.view.color.pixels[i], b.view.color.pixels[i], 1e-4) << i;
    ASSERT_NEAR(a.other_color.pixels[i], b.other_color.pixels[i], 1e-4) << i;
  }
  for (size_t i = 0; i < a.view.depth.pixels.size(); ++i)
    ASSERT_NEAR(a.view.depth.pixels[i], b.view.depth.pixels[i], 1e-3) << i;
}

// What rays see, in lists: the splats, their weights and directions. Both sides have the same
// operations in float, fused on the device or not; a threshold that is a rounding away, and the
// order of splats at one depth, may be decided otherwise.
TEST_F(DeviceSplatsTest, RaysSeeWhatTheySeeOnTheCpu) {
  const GridFrame box{{}, {0, 0, 0}, {1, 1, 1}};
  constexpr float kLeast = 1e-3f;
  int otherwise = 0, rays = 0;
  for (const Scene& scene : Scenes())
    for (const bool antialiased : {false, true}) {
      if (scene.splats.count() == 0 || scene.name == "one depth") continue;
      const RadianceField field =
          FieldOfSplats(scene.splats, box, 0.2f, antialiased ? 0.0f : -1.0f);
      const ViewRays pixels = testing::PixelsOf(
          {SplatCameraOf(75, 50), SplatCameraOf(8, 8), SplatCameraOf(131, 97)});
      const RayWeights exact =
          MakeRayWeigher(*field.geometry, field.near_clip, {}, kLeast)->Weigh(pixels);
      DeviceSplatWeigher weigher(SplatsOf(field), SplatOptionsOf(field), 1 << 30);
      const RayWeights got = DeviceRayWeigher(&weigher, kLeast).Weigh(pixels);
      ASSERT_EQ(got.num_rays(), exact.num_rays());
      for (size_t r = 0; r < pixels.rays.size(); ++r) {
        ++rays;
        const int64_t a = got.first[r], b = exact.first[r], n = got.first[r + 1] - a;
        bool same = n == exact.first[r + 1] - b;
        double off = std::abs(got.transmittance[r] - exact.transmittance[r]), turned = 0;
        for (int64_t i = 0; same && i < n; ++i) {
          const size_t at = static_cast<size_t>(a + i), to = static_cast<size_t>(b + i);
          same = got.samples[at].vertex == exact.samples[to].vertex;
          off = std::max(
              off, std::abs(double{got.samples[at].weight} - double{exact.samples[to].weight}));
          turned = std::max(turned, double{Norm(got.directions[at] - exact.directions[to])});
        }
        if (!same || !(off <= 1e-5)) {
          ++otherwise;
          EXPECT_NEAR(got.transmittance[r], exact.transmittance[r], 2 / 255.0) << scene.name;
          continue;
        }
        testing::RecordBound(scene.name + ": weights against the CPU", testing::Computed::kGpu,
                             off, 1e-5);
        EXPECT_LE(turned, 1e-6);
      }
    }
  EXPECT_LE(otherwise, testing::RecordBound("rays decided otherwise", testing::Computed::kGpu,
                                            otherwise, rays / 1000));
}

// Cameras that come again, whose lists were kept or not; rays in another order and in groups.
TEST_F(DeviceSplatsTest, WeightsDoNotDependOnMemoryOrGroups) {
  const RadianceField field = FieldOfSplats(CastSplats<float>(RandomSplats(3000, 4, 105)),
                                            {{}, {0, 0, 0}, {1, 1, 1}}, 0.2f, -1);
  const ViewRays pixels =
      testing::PixelsOf({SplatCameraOf(75, 50), SplatCameraOf(40, 30), SplatCameraOf(131, 97)});
  std::vector<RayWeights> all;
  for (const int64_t kept : {int64_t{0}, int64_t{20000}, int64_t{1} << 30}) {
    DeviceSplatWeigher weigher(SplatsOf(field), SplatOptionsOf(field), kept);
    for (int again = 0; again < 2; ++again)
      all.push_back(DeviceRayWeigher(&weigher, 1e-3f).Weigh(pixels));
    DeviceSplatSamples samples;
    const int64_t n = pixels.size(), third = n / 3;
    weigher.Weigh({{&pixels, 2 * third, n}, {nullptr, 0, 0}, {&pixels, 0, third}}, third + 2,
                  1e-3f, &samples);
    std::vector<int32_t> count(3);
    samples.count.CopyOut(count.data(), 3);
    const RayWeights& one = all.front();
    EXPECT_EQ(count[0], one.first.back() - one.first[static_cast<size_t>(2 * third)]);
    EXPECT_EQ(count[1], 0);
    EXPECT_EQ(count[2], one.first[static_cast<size_t>(third)]);
  }
  for (const RayWeights& weights : all) {
    ASSERT_EQ(weights.first, all.front().first);
    ASSERT_EQ(weights.transmittance, all.front().transmittance);
    for (size_t i = 0; i < weights.samples.size(); ++i) {
      ASSERT_EQ(weights.samples[i].vertex, all.front().samples[i].vertex);
      ASSERT_EQ(weights.samples[i].weight, all.front().samples[i].weight);
    }
  }
}

// Splats in larger arrays than they need, as a fit that adds some has them.
TEST_F(DeviceSplatsTest, ReservedRoomKeepsTheValues) {
  const Splats splats = CastSplats<float>(RandomSplats(100, 9, 103));
  DeviceSplats device;
  device.Upload(splats);
  device.Reserve(1000);
  EXPECT_GE(device.capacity(), 1000);
  const Splats back = device.Download();
  EXPECT_EQ(back.mean, splats.mean);
  EXPECT_EQ(back.quaternion, splats.quaternion);
  EXPECT_EQ(back.sh, splats.sh);
  EXPECT_EQ(back.count(), 100);
}

}  // namespace
}  // namespace regrade
