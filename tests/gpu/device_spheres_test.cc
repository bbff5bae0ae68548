// The parity table of background layers: each device function against the plain specification
// in float and double. Every test is skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/field/cuda/device_sphere_rays.h"
#include "kernels/field/render.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/sphere_variation.h"
#include "kernels/field/spherical_harmonics.h"
#include "tests/support/device_test.h"
#include "tests/support/double_field.h"
#include "tests/support/parity_row.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::AddSpheres;
using testing::DoubleField;
using testing::Largest;
using testing::ParityRow;
using testing::RandomField;
using testing::RandomRays;

// 70 layers: more than two blocks of a warp, and not a multiple of 32.
RadianceField WithLayers(int basis, double fill) {
  RadianceField field = RandomField({19, 18, 21}, basis, fill, 41);
  AddSpheres(70, 12, 0.8, 43, &field);
  return field;
}

Buffer<Ray> Rays(int n, uint64_t seed) {
  Buffer<Ray> rays(n);
  const std::vector<Ray> drawn = RandomRays(n, seed);
  std::copy(drawn.begin(), drawn.end(), rays.begin());
  return rays;
}

class DeviceSpheresParity : public testing::DeviceTestOfBasis {
 protected:
  void Row(const char* body, const char* against, double error, double tolerance) const {
    ParityRow(body, "basis " + std::to_string(basis()), against, error, tolerance);
  }
};

// A nearly empty box, and one that hides most of the background.
TEST_P(DeviceSpheresParity, Render) {
  for (const double fill : {0.02, 0.6}) {
    const RadianceField field = WithLayers(basis(), fill);
    const DoubleField in_double(field);
    const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
    Buffer<Ray> rays = Rays(2000, 32);
    rays[0].direction = {0, 0, 0};  // an invalid ray: the background
    rays[1].origin.x = std::nanf("");
    rays[2].origin = {1e12f, 0, 0};
    const MarchOptions options{0.5f, 1e-4f};
    const DeviceBuffer<Ray> on_device = DeviceBuffer<Ray>::Of(rays, "rays");
    DeviceBuffer<Vec3f> color(rays.size(), "colours");
    DeviceBuffer<float> depth(rays.size(), "depths"),
        transmittance(rays.size(), "transmittances");
    RenderOnDevice(grid, on_device.data(), rays.size(), options,
                   {color.data(), depth.data(), transmittance.data()});
    const Buffer<Vec3f> colors = color.ToHost();
    const Buffer<float> depths = depth.ToHost(), transmittances = transmittance.ToHost();
    double against_float = 0, against_double = 0, depth_error = 0, from_layers = 0;
    for (int64_t r = 0; r < rays.size(); ++r) {
      const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
      const RayT<double> ray{rays[r].origin.Cast<double>(), rays[r].direction.Cast<double>()};
      const RayResult<double> exact = RenderRay(in_double.view(), ray, options);
      from_layers += plain.spheres.depth > 0;
      for (int c = 0; c < 3; ++c) {
        const double value = static_cast<double>(colors[r][c]);
        ASSERT_TRUE(std::isfinite(value));
        against_float = std::max(against_float, std::abs(value - plain.color[c]));
        if (r > 2) against_double = std::max(against_double, std::abs(value - exact.color[c]));
      }
      against_float =
          std::max(against_float, std::abs(double{transmittances[r]} - plain.transmittance));
      // Relative: layers are up to 140 radii away.
      depth_error = std::max(
          depth_error, std::abs(double{depths[r]} - plain.depth) / std::max(1.0f, plain.depth));
    }
    EXPECT_GT(from_layers, 200);
    Row("render before layers", "plain float", against_float, 2e-5);
    Row("render before layers", "plain double", against_double, 1e-4);
    Row("depth of layers", "plain float, relative", depth_error, 1e-4);
  }
}

TEST_P(DeviceSpheresParity, Frame) {
  const RadianceField field = WithLayers(basis(), 0.3);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  Camera camera = testing::PinholeOf(37, 29, 40, 18, 15);
  camera.camera_from_world.translation = {0.1, -0.05, 2.5};
  const MarchOptions options{0.5f, 1e-4f};
  const RenderedView plain = RenderViewPlain(field, camera, options);
  const RenderedView view = RenderViewOnDevice(grid, camera, options);
  camera.lens = LensModel::kOpenCv;  // without distortion, but rays come from the host
  const RenderedView listed = RenderViewOnDevice(grid, camera, options);
  double error = 0, listed_error = 0, depth_error = 0;
  for (size_t i = 0; i < plain.color.pixels.size(); ++i) {
    const double value = plain.color.pixels[i];
    error = std::max(error, std::abs(double{view.color.pixels[i]} - value));
    listed_error = std::max(listed_error, std::abs(double{listed.color.pixels[i]} - value));
  }
  for (size_t i = 0; i < plain.depth.pixels.size(); ++i)
    depth_error =
        std::max(depth_error, std::abs(double{view.depth.pixels[i]} - plain.depth.pixels[i]) /
                                  std::max(1.0f, plain.depth.pixels[i]));
  Row("frame before layers", "plain float", error, 2e-5);
  Row("frame before layers, rays of a list", "plain float", listed_error, 2e-5);
  Row("depth of a frame before layers", "plain float", depth_error, 1e-3);
}

// Loss and gradients of a batch of rays.
struct Gradients {
  DeviceFitSums sums;
  Buffer<float> voxels, texels;
  Buffer<uint32_t> touched;
};
Gradients Accumulated(const DeviceGrid& grid, const Buffer<Ray>& rays, const Vec3f& target,
                      const MarchOptions& options, float scale, int64_t parts) {
  Buffer<Vec3f> targets(rays.size());
  for (Vec3f& t : targets) t = target;
  const DeviceBuffer<Ray> device_rays = DeviceBuffer<Ray>::Of(rays, "rays");
  const DeviceBuffer<Vec3f> device_targets = DeviceBuffer<Vec3f>::Of(targets, "targets");
  DeviceTouched touched(grid);
  DeviceRayFitter fitter(grid.frame, options, 64 << 20);
  for (int64_t p = 0; p < parts; ++p) {
    const int64_t begin = rays.size() * p / parts, end = rays.size() * (p + 1) / parts;
    fitter.Accumulate(grid, device_rays.data() + begin, device_targets.data() + begin,
                      end - begin, scale, &touched);
  }
  return {fitter.TakeSums(), DownloadGradient(grid),
          DownloadGradient(grid.spheres, grid.exact_sums), touched.bits.ToHost()};
}

// Against the plain adjoint in double, 1e-4 of the largest entry as for the box alone. One row
// is without early stops; the other measures the difference in how far rays are marched behind
// the box.
TEST_P(DeviceSpheresParity, FitGradient) {
  const RadianceField field = WithLayers(basis(), 0.25);
  const DoubleField in_double(field);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field), true);
  const Buffer<Ray> rays = Rays(700, 42);
  const Vec3f target{0.4f, 0.5f, 0.2f};
  const float scale = 1.0f / 600;
  for (const float stop : {0.0f, 1e-3f}) {
    const MarchOptions options{0.5f, stop};
    const DeviceGrid fresh = UploadGrid(MakeFastGrid(field), true);
    const Gradients is = Accumulated(fresh, rays, target, options, scale, 1);
    const testing::ExactGradient exact(in_double, rays, std::vector<Vec3f>(700, target),
                                       options, double{scale});
    double off_voxels = 0, off_density = 0, off_color = 0;
    for (int64_t v = 0; v < grid.num_voxels(); ++v)
      off_voxels =
          std::max(off_voxels, std::abs(is.voxels[v * grid.lanes() + DensityLane(basis())] -
                                        exact.density[static_cast<size_t>(v)]));
    int64_t with_gradient = 0;
    for (int64_t t = 0; t < grid.spheres.num_texels(); ++t) {
      off_density = std::max(
          off_density,
          std::abs(is.texels[4 * t + 3] - exact.sphere_density[static_cast<size_t>(t)]));
      for (int c = 0; c < 3; ++c)
        off_color =
            std::max(off_color, std::abs(is.texels[4 * t + c] -
                                         exact.sphere_color[static_cast<size_t>(3 * t + c)]));
      if (is.texels[4 * t + 3] == 0) continue;
      ++with_gradient;
      const int64_t point = grid.first_texel() + t;
      ASSERT_NE(is.touched[point / 32] & (1u << point % 32), 0u) << t;
    }
    EXPECT_GT(with_gradient, 1000);
    // A stopped ray loses at most `stop` of its light, of colours that differ by 3 at most.
    const double most = 1e-4 + 3 * static_cast<double>(stop);
    const char* against = stop > 0 ? "plain double, of the largest, rays stopped"
                                   : "plain double, of the largest";
    Row("loss before layers", against,
        std::abs(is.sums.squared_error - exact.error) / exact.error, stop > 0 ? most : 1e-5);
    Row("gradient of densities before layers", against, off_voxels / Largest(exact.density),
        most);
    Row("gradient of layers' densities", against, off_density / Largest(exact.sphere_density),
        most);
    Row("gradient of layers' colours", against, off_color / Largest(exact.sphere_color), most);
  }
}

TEST_P(DeviceSpheresParity, ExactSumsAreTheSameBitsInAnyOrder) {
  const RadianceField field = WithLayers(basis(), 0.25);
  Buffer<Ray> rays = Rays(600, 7);
  Buffer<float> texels[3];
  for (int i = 0; i < 3; ++i) {
    const DeviceGrid grid = UploadGrid(MakeFastGrid(field), true, {}, i < 2);
    texels[i] =
        Accumulated(grid, rays, {0.4f, 0.5f, 0.2f}, {0.5f, 1e-4f}, 1.0f / 1800, 1 + i).texels;
    std::reverse(rays.begin(), rays.end());
  }
  double off = 0, largest = 0;
  for (int64_t i = 0; i < texels[0].size(); ++i) {
    ASSERT_EQ(texels[0][i], texels[1][i]) << i;
    off = std::max(off, std::abs(double{texels[0][i]} - texels[2][i]));
    largest = std::max(largest, std::abs(double{texels[2][i]}));
  }
  Row("exact sums of layers", "float sums, of the largest", off / largest, 1e-5);
}

TEST_P(DeviceSpheresParity, SphereVariation) {
  const FastGrid host = MakeFastGrid(WithLayers(basis(), 0.25));
  const FastSpheres& spheres = host.spheres;
  const int64_t map = spheres.links.size();
  std::vector<double> values(spheres.texels.begin(), spheres.texels.end()), expected(values);
  std::fill(expected.begin(), expected.end(), 0.0);
  for (int c = 0; c < 4; ++c)
    SphereVariation(spheres.layers, spheres.resolution, spheres.links.data(), values.data(), 4,
                    c, 0, map, c == 3 ? 0.3 : 0.2, [&](int32_t texel, double d) {
                      expected[static_cast<size_t>(4 * texel + c)] += d;
                    });
  for (const bool exact : {false, true}) {
    const DeviceGrid grid = UploadGrid(host, true, {}, exact);
    DeviceTouched touched(grid);
    // All texels from an arbitrary start: the run wraps around.
    AddSphereVariation(grid, map / 3, map, 0.3f, 0.2f, &touched);
    const Buffer<float> is = DownloadGradient(grid.spheres, exact);
    double off = 0;
    for (int64_t i = 0; i < is.size(); ++i)
      off = std::max(off, std::abs(is[i] - expected[static_cast<size_t>(i)]));
    Row("total variation of layers", "plain double", off, 2e-6);
  }
}

// H103, H104 on layers: steps are sparse, bounded, and skip non-finite gradients.
TEST_P(DeviceSpheresParity, Step) {
  const FastGrid before = MakeFastGrid(WithLayers(basis(), 0.25));
  DeviceGrid grid = UploadGrid(before, true);
  const int64_t n = grid.spheres.num_texels();
  Buffer<float> g(4 * n);
  DeviceTouched marks(grid);
  Buffer<uint32_t> touched(marks.bits.size());
  for (const int64_t texel : {int64_t{5}, int64_t{33}, n - 1}) {
    const int64_t point = grid.first_texel() + texel;
    touched[point / 32] |= 1u << point % 32;
    for (int c = 0; c < 4; ++c)
      g[4 * texel + c] =
          static_cast<float>(testing::Uniform(9, static_cast<uint64_t>(4 * texel + c), -1, 1));
  }
  g[4 * 33] = std::nanf("");
  grid.spheres.gradient.CopyIn(g.data(), g.size());
  marks.bits.CopyIn(touched.data(), touched.size());
  DeviceBuffer<DeviceFitSums> sums(1, "sums");
  sums.Zero();
  RmspropOptions options{.rate_sphere_density = 0.5f, .rate_sphere_color = 0.3f};
  StepSpheresOnDevice(&grid, &marks, options, sums.data());
  const FastSpheres after = DownloadSpheres(grid.spheres);
  DeviceFitSums taken;
  sums.CopyOut(&taken, 1);
  EXPECT_EQ(taken.rejected_voxels, 1u);
  double off = 0;
  for (int64_t i = 0; i < 4 * n; ++i) {
    const float old = before.spheres.texels[i], now = after.texels[i];
    if (i / 4 != 5 && i / 4 != n - 1) {
      ASSERT_EQ(old, now) << i;
      continue;
    }
    const bool is_density = i % 4 == 3;
    const double d = g[i];
    double expected = old - (is_density ? 0.5 : 0.3) * d / (std::abs(d) + 1e-8);
    if (!is_density) expected = std::clamp(expected, -0.5 / kSh0, 0.5 / kSh0);
    off = std::max(off, std::abs(now - expected));
  }
  Row("step of layers", "definition in double", off, 1e-5);
  for (const float rest : DownloadGradient(grid.spheres, false)) ASSERT_EQ(rest, 0.0f);
  for (const uint32_t rest : marks.bits.ToHost()) ASSERT_EQ(rest, 0u);
}

TEST_P(DeviceSpheresParity, UploadAndDownload) {
  const FastGrid host = MakeFastGrid(WithLayers(basis(), 0.25));
  const FastSpheres back = DownloadGrid(UploadGrid(host)).spheres;
  EXPECT_EQ(back.layers, host.spheres.layers);
  EXPECT_EQ(back.resolution, host.spheres.resolution);
  ASSERT_EQ(back.links.size(), host.spheres.links.size());
  for (int64_t i = 0; i < back.links.size(); ++i)
    ASSERT_EQ(back.links[i], host.spheres.links[i]);
  ASSERT_EQ(back.texels.size(), host.spheres.texels.size());
  for (int64_t i = 0; i < back.texels.size(); ++i)
    ASSERT_EQ(back.texels[i], host.spheres.texels[i]);
}

INSTANTIATE_TEST_SUITE_P(AllBases, DeviceSpheresParity, ::testing::Values(1, 4, 9),
                         [](const auto& info) { return "basis" + std::to_string(info.param); });

}  // namespace
}  // namespace regrade
