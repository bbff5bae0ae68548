// The parity table: each device function against the plain specification in float and double.
// The program links kernels and GoogleTest only, so it runs on a bare machine with a CUDA
// driver; every test is skipped without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/device_views.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/total_variation.h"
#include "kernels/optimize/rmsprop.h"
#include "tests/support/device_test.h"
#include "tests/support/double_field.h"
#include "tests/support/parity_row.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::DoubleField;
using testing::RandomField;
using testing::RandomRays;

class DeviceParity : public testing::DeviceTestOfBasis {};

void Row(const char* body, int basis, const char* against, double error, double tolerance) {
  testing::ParityRow(body, "basis " + std::to_string(basis), against, error, tolerance);
}

// H70: 2e-5 per pixel against the plain ray in float and in double; H84: skipping empty space
// does not change the picture.
TEST_P(DeviceParity, Render) {
  for (const double fill : {0.003, 0.05, 0.9}) {
    const RadianceField field = RandomField({33, 27, 41}, basis(), fill, 31);
    const DoubleField in_double(field);
    const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
    Buffer<Ray> rays(2000);
    const std::vector<Ray> drawn = RandomRays(static_cast<int>(rays.size()), 32);
    std::copy(drawn.begin(), drawn.end(), rays.begin());
    rays[0].direction = {0, 0, 0};  // an invalid ray: the background
    rays[1].origin.x = std::nanf("");
    const MarchOptions options{0.5f, 1e-4f};
    const DeviceBuffer<Ray> on_device = DeviceBuffer<Ray>::Of(rays, "rays");
    DeviceBuffer<Vec3f> color(rays.size(), "colours");
    DeviceBuffer<float> depth(rays.size(), "depths"),
        transmittance(rays.size(), "transmittances");
    RenderOnDevice(grid, on_device.data(), rays.size(), options,
                   {color.data(), depth.data(), transmittance.data()});
    const Buffer<Vec3f> colors = color.ToHost();
    const Buffer<float> depths = depth.ToHost(), transmittances = transmittance.ToHost();
    double against_float = 0, against_double = 0, depth_error = 0;
    for (int64_t r = 0; r < rays.size(); ++r) {
      const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
      const RayT<double> ray{rays[r].origin.Cast<double>(), rays[r].direction.Cast<double>()};
      const RayResult<double> exact = RenderRay(in_double.view(), ray, options);
      for (int c = 0; c < 3; ++c) {
        const double value = static_cast<double>(colors[r][c]);
        ASSERT_TRUE(std::isfinite(value));
        against_float = std::max(against_float, std::abs(value - plain.color[c]));
        against_double = std::max(against_double, std::abs(value - exact.color[c]));
      }
      against_float =
          std::max(against_float, std::abs(double{transmittances[r]} - plain.transmittance));
      depth_error = std::max(depth_error, std::abs(double{depths[r]} - plain.depth));
    }
    Row("render", basis(), "plain float", against_float, 2e-5);
    Row("render", basis(), "plain double", against_double,
        1e-4);  // one sample more or less at the stop
    Row("depth", basis(), "plain float", depth_error, 1e-4);
  }
}

Camera SmallCamera(bool ndc) {
  Camera camera = testing::PinholeOf(37, 29, 40, 18, 15);
  camera.camera_from_world.translation = {0.1, -0.05, ndc ? 0.0 : 2.5};
  if (ndc) camera.ndc = {2 * 40.0 / 37, 2 * 40.0 / 29};
  return camera;
}

// Frames equal the plain ray's pixels.
TEST_P(DeviceParity, Frame) {
  const RadianceField field = RandomField({33, 27, 41}, basis(), 0.5, 31);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  for (const bool ndc : {false, true}) {
    const Camera camera = SmallCamera(ndc);
    const MarchOptions options{0.5f, 1e-4f};
    const RenderedView plain = RenderViewPlain(field, camera, options);
    double error = 0, depth_error = 0, seen = 0;
    const RenderedView view = RenderViewOnDevice(grid, camera, options);
    for (size_t i = 0; i < plain.color.pixels.size(); ++i) {
      const double value = plain.color.pixels[i];
      error = std::max(error, std::abs(double{view.color.pixels[i]} - value));
    }
    for (size_t i = 0; i < plain.depth.pixels.size(); ++i) {
      seen += plain.depth.pixels[i] > 0;
      // Relative: depths of NDC rays go to infinity.
      depth_error =
          std::max(depth_error, std::abs(double{view.depth.pixels[i]} - plain.depth.pixels[i]) /
                                    std::max(1.0f, plain.depth.pixels[i]));
    }
    ASSERT_GT(seen, 100);
    Row("frame", basis(), ndc ? "plain float, NDC" : "plain float", error, 2e-5);
    Row("depth of a frame", basis(), ndc ? "plain float, NDC" : "plain float", depth_error,
        1e-3);
  }
}

// Pruned and resampled voxels against the rule, applied one vertex at a time.
TEST_P(DeviceParity, Resample) {
  const RadianceField field = RandomField({9, 7, 11}, basis(), 0.4, 61);
  const FastGrid before = MakeFastGrid(field);
  const DeviceGrid grid = UploadGrid(before, true);
  Buffer<float> weights(before.num_voxels());
  for (int64_t v = 0; v < weights.size(); ++v)
    weights[v] = static_cast<float>(testing::Uniform(5, static_cast<uint64_t>(v), 0, 1));
  const float threshold = 0.93f;
  const Vec3i resolution{18, 13, 23};
  const DeviceGrid next = ResampleOnDevice(grid, DeviceBuffer<float>::Of(weights, "weights"),
                                           threshold, resolution);
  const FastGrid after = DownloadGrid(next);
  const Vec3i n = before.frame.resolution;
  const auto kept = [&](int x, int y, int z) {
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, n.x - 1); ++i)
      for (int j = std::max(y - 1, 0); j <= std::min(y + 1, n.y - 1); ++j)
        for (int k = std::max(z - 1, 0); k <= std::min(z + 1, n.z - 1); ++k) {
          const int32_t link = before.links[before.frame.Vertex(i, j, k)];
          if (link >= 0 && weights[link] >= threshold) return true;
        }
    return false;
  };
  const Vec3f scale = after.frame.Scale(), offset = after.frame.Offset();
  const Vec3f old_scale = before.frame.Scale(), old_offset = before.frame.Offset();
  int64_t stored = 0, missing = 0;
  double off = 0;
  std::vector<bool> numbers(static_cast<size_t>(after.num_voxels()));
  for (int x = 0; x < resolution.x; ++x)
    for (int y = 0; y < resolution.y; ++y)
      for (int z = 0; z < resolution.z; ++z) {
        Vec3f p{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        for (int a = 0; a < 3; ++a)
          p[a] = std::clamp((p[a] - offset[a]) / scale[a] * old_scale[a] + old_offset[a], 0.0f,
                            static_cast<float>(n[a] - 1));
        const int32_t link = after.links[after.frame.Vertex(x, y, z)];
        const bool keep =
            kept(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)),
                 static_cast<int>(std::lround(p.z)));
        ASSERT_EQ(link >= 0, keep) << x << " " << y << " " << z;
        missing += !keep;
        if (!keep) continue;
        ++stored;
        ASSERT_LT(link, after.num_voxels());
        ASSERT_FALSE(numbers[static_cast<size_t>(link)]);
        numbers[static_cast<size_t>(link)] = true;
        std::vector<float> expected(static_cast<size_t>(before.lanes()));
        Interpolate(before.frame, before.links.data(), before.records.data(), before.lanes(),
                    before.lanes(), LocateCell(before.frame, p), expected.data());
        for (int k = 0; k <= DensityLane(basis()); ++k)
          off = std::max(off, std::abs(double{after.records[link * after.lanes() + k]} -
                                       double{expected[static_cast<size_t>(k)]}));
      }
  ASSERT_EQ(stored, after.num_voxels());
  ASSERT_GT(stored, 100);
  ASSERT_GT(missing, 100);
  Row("resampled voxels", basis(), "plain float", off, 1e-5);
}

// Float gradients against the plain adjoint in double: 1e-4 of the largest entry, as for the
// CPU's fast path.
TEST_P(DeviceParity, FitGradient) {
  const RadianceField field = RandomField({19, 18, 21}, basis(), 0.7, 41);
  const DoubleField in_double(field);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field), true);
  Buffer<Ray> rays(700);
  const std::vector<Ray> drawn = RandomRays(static_cast<int>(rays.size()), 42);
  std::copy(drawn.begin(), drawn.end(), rays.begin());
  Buffer<Vec3f> targets(rays.size());
  for (Vec3f& target : targets) target = {0.4f, 0.5f, 0.2f};
  const MarchOptions options{0.5f, 1e-4f};
  const float scale = 1.0f / 600;
  DeviceTouched touched_voxels(grid);
  DeviceRayFitter fitter(grid.frame, options, 64 << 20);
  const DeviceBuffer<Ray> device_rays = DeviceBuffer<Ray>::Of(rays, "rays");
  const DeviceBuffer<Vec3f> device_targets = DeviceBuffer<Vec3f>::Of(targets, "targets");
  const DensityLosses losses{1e-4f, 1e-2f};
  fitter.Accumulate(grid, device_rays.data(), device_targets.data(), rays.size(), scale,
                    &touched_voxels, losses);
  const DeviceFitSums sums = fitter.TakeSums();
  const Buffer<float> g = DownloadGradient(grid);
  const Buffer<uint32_t> touched = touched_voxels.bits.ToHost();

  const testing::ExactGradient exact(in_double, rays, targets, options, double{scale}, losses);
  Row("loss", basis(), "plain double, relative",
      std::abs(sums.squared_error - exact.error) / exact.error, 1e-5);
  double off_density = 0, off_sh = 0;
  const int stride = 3 * basis(), lanes = grid.lanes();
  for (int64_t v = 0; v < grid.num_voxels(); ++v) {
    bool any = false;
    for (int k = 0; k < stride; ++k) {
      off_sh = std::max(off_sh, std::abs(g[v * lanes + k] - exact.sh[v * stride + k]));
      any = any || g[v * lanes + k] != 0;
    }
    off_density = std::max(off_density, std::abs(g[v * lanes + stride] - exact.density[v]));
    if (any) {
      ASSERT_NE(touched[v / 32] & (1u << v % 32), 0u) << v;
    }
  }
  Row("gradient of densities", basis(), "plain double, of the largest",
      off_density / testing::Largest(exact.density), 1e-4);
  Row("gradient of colours", basis(), "plain double, of the largest",
      off_sh / testing::Largest(exact.sh), 1e-4);
}

TEST_P(DeviceParity, TotalVariation) {
  const RadianceField field = RandomField({9, 11, 10}, basis(), 0.6, 55);
  const FastGrid host = MakeFastGrid(field);
  const DeviceGrid grid = UploadGrid(host, true);
  DeviceTouched touched(grid);
  const int64_t n = host.num_voxels(), begin = n / 3;
  // All voxels from an arbitrary start: the run wraps around.
  AddTotalVariation(grid, begin, n, 0.3f, 0.2f, &touched);
  DeviceWait("total variation");
  const Buffer<float> g = DownloadGradient(grid);
  const int lanes = host.lanes();
  std::vector<double> records(static_cast<size_t>(n * lanes)), expected(records.size());
  for (int64_t i = 0; i < n * lanes; ++i) records[static_cast<size_t>(i)] = host.records[i];
  for (int k = 0; k <= DensityLane(basis()); ++k) {
    const bool is_density = k == DensityLane(basis());
    TotalVariation<double>(host.frame, host.links.data(), records.data(), lanes, k, is_density,
                           0, host.frame.NumVertices(), is_density ? 0.3f : 0.2f,
                           expected.data());
  }
  double off = 0;
  for (int64_t i = 0; i < n * lanes; ++i)
    off = std::max(off, std::abs(g[i] - expected[static_cast<size_t>(i)]));
  Row("total variation", basis(), "plain double", off, 2e-6);
}

// H103, H104: steps are sparse, bounded, and skip non-finite gradients.
TEST_P(DeviceParity, Step) {
  const FastGrid before = MakeFastGrid(RandomField({4, 4, 4}, basis(), 1.0, 51));
  DeviceGrid grid = UploadGrid(before, true);
  const int lanes = before.lanes();
  const int64_t n = before.num_voxels();
  DeviceTouched marks(grid);
  Buffer<float> g(n * lanes);
  Buffer<uint32_t> touched((n + 31) / 32);
  for (const int32_t voxel : {5, 11, 23}) {
    touched[voxel / 32] |= 1u << voxel % 32;
    for (int k = 0; k <= DensityLane(basis()); ++k)
      g[voxel * lanes + k] =
          static_cast<float>(testing::Uniform(9, static_cast<uint64_t>(voxel * 40 + k), -1, 1));
  }
  g[11 * lanes] = std::nanf("");
  DeviceCopyRows(grid.gradient(), 12 * lanes, g.data(), 4 * lanes, 4 * lanes, n);
  marks.bits.CopyIn(touched.data(), touched.size());
  DeviceBuffer<DeviceFitSums> sums(1, "sums");
  sums.Zero();
  const RmspropOptions options{.rate_sh = 0.05f, .rate_density = 0.5f, .view_bound = 0.2f};
  StepOnDevice(&grid, &marks, options, sums.data());
  const FastGrid after = DownloadGrid(grid);
  const Buffer<float> densities = grid.dense_density.ToHost();
  DeviceFitSums taken;
  sums.CopyOut(&taken, 1);
  EXPECT_EQ(taken.rejected_voxels, 1u);
  double off = 0;
  for (int64_t v = 0; v < n; ++v)
    for (int k = 0; k < lanes; ++k) {
      const float old = before.records[v * lanes + k], now = after.records[v * lanes + k];
      if (v != 5 && v != 23) {
        ASSERT_EQ(old, now);
        continue;
      }
      if (k > DensityLane(basis())) continue;
      const bool is_density = k == DensityLane(basis());
      const double gradient_value = g[v * lanes + k];
      double expected =
          old - (is_density ? 0.5 : 0.05) * gradient_value / (std::abs(gradient_value) + 1e-8);
      if (!is_density) {
        const double bound = k % basis() == 0 ? 0.5 / kSh0 : double{0.2f};
        expected = std::clamp(expected, -bound, bound);
      }
      off = std::max(off, std::abs(now - expected));
    }
  Row("step", basis(), "definition in double", off, 1e-5);
  const int32_t vertex = after.vertex_of_voxel[5];
  EXPECT_EQ(densities[vertex], after.records[5 * lanes + DensityLane(basis())]);
  for (const float rest : DownloadGradient(grid)) ASSERT_EQ(rest, 0.0f);
  for (const uint32_t rest : marks.bits.ToHost()) ASSERT_EQ(rest, 0u);
}

// Upload and download: links, records and derived arrays equal the host's.
TEST_P(DeviceParity, UploadAndDownload) {
  const FastGrid host = MakeFastGrid(RandomField({21, 9, 17}, basis(), 0.02, 3));
  const DeviceGrid grid = UploadGrid(host);
  // Chebyshev distance of cells, named by their lowest corner, to the nearest with a stored
  // corner.
  const Vec3i n = host.frame.resolution;
  const auto stored = [&](int x, int y, int z) {
    for (int k = 0; k < 8; ++k) {
      const int cx = x + (k >> 2 & 1), cy = y + (k >> 1 & 1), cz = z + (k & 1);
      if (cx < n.x && cy < n.y && cz < n.z && host.links[host.frame.Vertex(cx, cy, cz)] >= 0)
        return true;
    }
    return false;
  };
  std::vector<Vec3i> cells;
  for (int64_t v = 0; v < host.links.size(); ++v) {
    const Vec3i at{static_cast<int>(v / (n.y * n.z)), static_cast<int>(v / n.z % n.y),
                   static_cast<int>(v % n.z)};
    if (stored(at.x, at.y, at.z)) cells.push_back(at);
  }
  const Buffer<uint8_t> distance = grid.empty_distance.ToHost();
  for (int64_t v = 0; v < distance.size(); ++v) {
    int nearest = 16;
    for (const Vec3i& c : cells)
      nearest = std::min(nearest, std::max({std::abs(c.x - static_cast<int>(v / (n.y * n.z))),
                                            std::abs(c.y - static_cast<int>(v / n.z % n.y)),
                                            std::abs(c.z - static_cast<int>(v % n.z))}));
    ASSERT_EQ(distance[v], nearest) << v;
  }
  const FastGrid back = DownloadGrid(grid);
  for (int64_t i = 0; i < host.records.size(); ++i) ASSERT_EQ(host.records[i], back.records[i]);
}

INSTANTIATE_TEST_SUITE_P(AllBases, DeviceParity, ::testing::Values(1, 4, 9),
                         [](const auto& info) { return "basis" + std::to_string(info.param); });

}  // namespace
}  // namespace regrade
