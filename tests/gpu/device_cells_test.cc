// Adaptive fields on the device against the plain specification and the host; skipped without a
// device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/field/cell_variation.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/cuda/device_cell_render.h"
#include "kernels/field/cuda/device_cell_statistics.h"
#include "kernels/field/cuda/device_free_space.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"
#include "reconstruct/fit/measure_cells.h"
#include "tests/support/cell_field.h"
#include "tests/support/device_rays_on_host.h"
#include "tests/support/device_test.h"
#include "tests/support/double_field.h"
#include "tests/support/parity_row.h"

namespace regrade {
namespace {

using testing::DoubleField;
using testing::RandomCellField;
using testing::RandomRays;

class DeviceCellsTest : public testing::DeviceTestOfBasis {};

void Row(const char* body, int basis, const char* against, double error, double tolerance) {
  testing::ParityRow(body, "cells, basis " + std::to_string(basis), against, error, tolerance);
}

DeviceBuffer<Ray> OnDevice(const std::vector<Ray>& rays) {
  DeviceBuffer<Ray> device(static_cast<int64_t>(rays.size()), "rays");
  device.CopyIn(rays.data(), device.size());
  return device;
}

TEST_P(DeviceCellsTest, Render) {
  const RadianceField field = RandomCellField({5, 4, 4}, 3, basis(), 31);
  const DoubleField in_double(field);
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  std::vector<Ray> rays = RandomRays(2000, 32);
  rays[0].direction = {0, 0, 0};
  rays[1].origin.x = std::nanf("");
  const MarchOptions options{0.5f, 1e-4f};
  const DeviceBuffer<Ray> on_device = OnDevice(rays);
  const int64_t n = on_device.size();
  DeviceBuffer<Vec3f> color(n, "colours");
  DeviceBuffer<float> depth(n, "depths"), transmittance(n, "transmittances");
  RenderOnDevice(grid, on_device.data(), n, options,
                 {color.data(), depth.data(), transmittance.data()});
  const Buffer<Vec3f> colors = color.ToHost();
  const Buffer<float> depths = depth.ToHost();
  double error = 0, exact_error = 0, depth_error = 0;
  for (int64_t r = 0; r < n; ++r) {
    const Ray& ray = rays[static_cast<size_t>(r)];
    const RayResult<float> plain = RenderRay(ViewOf(field), ray, options);
    const RayResult<double> exact = RenderRay(
        in_double.view(), {ray.origin.Cast<double>(), ray.direction.Cast<double>()}, options);
    for (int c = 0; c < 3; ++c) {
      ASSERT_TRUE(std::isfinite(colors[r][c]));
      error = std::max(error, std::abs(double{colors[r][c]} - plain.color[c]));
      exact_error = std::max(exact_error, std::abs(double{colors[r][c]} - exact.color[c]));
    }
    depth_error = std::max(depth_error, std::abs(double{depths[r]} - plain.depth));
  }
  Row("render", basis(), "plain float", error, 2e-5);
  Row("render", basis(), "plain double", exact_error, 1e-4);
  Row("depth", basis(), "plain float", depth_error, 1e-4);
}

TEST_P(DeviceCellsTest, AnAdaptiveFieldHasNoHalfGrid) {
  const RadianceField field = RandomCellField({5, 4, 4}, 3, basis(), 35);
  EXPECT_TRUE(MakeHalfGrid(UploadGrid(MakeFastGrid(field))).empty());
}

Camera FrameCamera(bool ndc) {
  Camera camera;
  camera.width = 53;  // not whole tiles
  camera.height = 37;
  camera.fx = camera.fy = 40;
  camera.cx = 26;
  camera.cy = 18;
  camera.camera_from_world.translation = {0, 0, ndc ? -0.1 : 3};
  if (ndc) camera.ndc = {2 * 40.0 / 53, 2 * 40.0 / 37};
  return camera;
}

// A frame's rays are made on the device; a view's, on the host for a lens with distortion.
TEST_P(DeviceCellsTest, AFrameIsTheViewOfItsRays) {
  const RadianceField field = RandomCellField({5, 4, 4}, 3, basis(), 33);
  const FastGrid host = MakeFastGrid(field);
  const DeviceGrid grid = UploadGrid(host);
  const Camera camera = FrameCamera(false);
  const MarchOptions options{0.5f, 1e-4f};
  const RenderedView is = RenderViewOnDevice(grid, camera, options);
  const RenderedView should = RenderView(host, camera, options);
  double off = 0, depth_off = 0;
  for (size_t i = 0; i < is.color.pixels.size(); ++i)
    off = std::max(off, std::abs(double{is.color.pixels[i]} - should.color.pixels[i]));
  for (size_t i = 0; i < is.depth.pixels.size(); ++i)
    if (std::isfinite(should.depth.pixels[i]))
      depth_off =
          std::max(depth_off, std::abs(double{is.depth.pixels[i]} - should.depth.pixels[i]));
  Row("frame", basis(), "CPU", off, 2e-5);
  Row("depths of a frame", basis(), "CPU", depth_off, 1e-3);
}

// The host's rays are tested in cell_ray_test.cc.
TEST_P(DeviceCellsTest, VertexColorsGiveTheHostsPixels) {
  FastGrid host = MakeFastGrid(RandomCellField({5, 4, 4}, 3, basis(), 33));
  const DeviceGridView view = testing::HostView(&host);
  const DeviceGrid grid = UploadGrid(host);
  const VertexColors room = MakeVertexColors(grid);
  for (const bool ndc : {false, true})
    for (const float wide_angle : {1e9f, 1.0f / 40}) {  // no cell is wide, some are
      const Camera camera = FrameCamera(ndc);
      const int64_t n = int64_t{camera.width} * camera.height;
      DeviceBuffer<Vec3f> color(n, "colours");
      DeviceBuffer<float> depth(n, "depths"), transmittance(n, "transmittances");
      RenderCellFrame(grid, camera, {0.5f, 1e-4f},
                      {color.data(), depth.data(), transmittance.data()}, &room, wide_angle);
      const Buffer<Vec3f> is = color.ToHost();
      const PinholeRays rays(camera);
      const ResolvePixel resolve(camera);
      const Vec3f scale = host.frame.Scale();
      const float wide_until =
          ndc ? 0 : 1 / (std::min({scale.x, scale.y, scale.z}) * wide_angle);
      double off = 0;
      const auto compare = [&](auto constant) {
        const std::vector<FourFloats> colors = testing::ColorsOf<constant.value>(view, rays);
        for (int64_t i = 0; i < n; ++i) {
          const Ray ray =
              rays.At(static_cast<int>(i % camera.width), static_cast<int>(i / camera.width));
          CellRaySums sums =
              RenderCellRay<constant.value, true>(view, ray, colors.data(), wide_until, 1e-4f);
          resolve(ray, sums.transmittance, &sums.color, &sums.depth);
          for (int c = 0; c < 3; ++c)
            off = std::max(off, std::abs(double{is[i][c]} - sums.color[c]));
        }
      };
      if (basis() == 9) compare(std::integral_constant<int, 9>());
      if (basis() == 4) compare(std::integral_constant<int, 4>());
      if (basis() == 1) compare(std::integral_constant<int, 1>());
      Row(ndc ? "frame by vertices' colours, NDC" : "frame by vertices' colours", basis(),
          wide_angle > 1 ? "host, no cell wide" : "host, some cells wide", off, 2e-5);
    }
}

TEST_P(DeviceCellsTest, FitGradientAndVariation) {
  const RadianceField field = RandomCellField({3, 2, 2}, 2, basis(), 41);
  const DoubleField d(field);
  const std::vector<Ray> rays = RandomRays(300, 42);
  const DeviceBuffer<Ray> on_device = OnDevice(rays);
  std::vector<Vec3f> targets(rays.size(), Vec3f{0.4f, 0.5f, 0.2f});
  DeviceBuffer<Vec3f> device_targets(on_device.size(), "targets");
  device_targets.CopyIn(targets.data(), device_targets.size());
  const MarchOptions options{0.5f, 1e-4f};
  const float scale = 1.0f / 900;
  std::vector<double> d_density(d.density.size()), d_sh(d.sh.size());
  double squares = 0;
  for (size_t r = 0; r < rays.size(); ++r) {
    const RayT<double> ray{rays[r].origin.Cast<double>(), rays[r].direction.Cast<double>()};
    const RayResult<double> result = RenderRay(d.view(), ray, options);
    const Vec3d off = result.color - targets[r].Cast<double>();
    squares += Dot(off, off);
    RenderRayAdjoint(d.view(), ray, options, result, off * (2.0 * scale), d_density.data(),
                     d_sh.data(), PlainAdd());
  }
  const CellGrid& cells = field.geometry->cells;
  const CellsView view = ViewOf(cells, field.geometry->frame.resolution);
  std::vector<double> unit, one(static_cast<size_t>(cells.finest) + 1, 1.0);
  for (int level = 0; level <= cells.finest; ++level)
    unit.push_back(WorldWidth(field.geometry->frame, 1 << (cells.finest - level)));
  const int stride = 3 * basis();
  const int64_t begin = cells.num_cells() - 20, count = 45;  // wraps around
  for (int64_t i = 0; i < count; ++i) {
    const int64_t c = (begin + i) % cells.num_cells();
    CellVariation<double>(view, d.density.data(), 1, 0, unit.data(), c, c + 1, 0.7e-3,
                          d_density.data());
    for (int k = 0; k < stride; ++k)
      CellVariation<double>(view, d.sh.data(), stride, k, one.data(), c, c + 1, 0.2e-3,
                            d_sh.data());
  }
  for (const bool exact_sums : {false, true}) {
    DeviceGrid grid = UploadGrid(MakeFastGrid(field), true, {}, exact_sums);
    DeviceTouched touched(grid);
    for (const int64_t store :
         {int64_t{1} << 28, int64_t{1} << 16}) {  // the second one needs several turns
      grid = UploadGrid(MakeFastGrid(field), true, {}, exact_sums);
      DeviceRayFitter fitter(grid.frame, options, store);
      fitter.Accumulate(grid, on_device.data(), device_targets.data(), on_device.size(), scale,
                        &touched);
      AddTotalVariation(grid, begin, count, 0.7e-3f, 0.2e-3f, &touched);
      const Buffer<float> gradient = DownloadGradient(grid);
      double largest = 0, worst = 0;
      const int lanes = RecordLanes(basis());
      for (int64_t v = 0; v < cells.num_vertices(); ++v)
        for (int i = 0; i <= stride; ++i) {
          const double plain = i < stride ? d_sh[static_cast<size_t>(v * stride + i)]
                                          : d_density[static_cast<size_t>(v)];
          largest = std::max(largest, std::abs(plain));
          worst = std::max(worst, std::abs(gradient[v * lanes + i] - plain));
        }
      Row("gradient of a fit", basis(),
          exact_sums ? "plain double, exact sums" : "plain double", worst / largest, 1e-4);
      EXPECT_NEAR(fitter.TakeSums().squared_error, squares, 1e-4 * squares);
    }
  }
}

TEST_P(DeviceCellsTest, FreeSpace) {
  const RadianceField field = RandomCellField({3, 2, 2}, 2, basis(), 51);
  const DoubleField d(field);
  const CellsView view = ViewOf(field.geometry->cells, field.geometry->frame.resolution);
  std::vector<FreeRay> rays;
  for (const Ray& ray : RandomRays(40, 52)) rays.push_back({ray, 1.7f});
  constexpr int kDrawn = 500;
  constexpr uint64_t kSeed = 9, kStep = 3;
  std::vector<double> plain(d.density.size());
  for (int i = 0; i < kDrawn; ++i) {
    const FreeRay& free =
        rays[RandomIndex(kSeed, kStep, static_cast<uint64_t>(i), rays.size())];
    const RayT<double> ray = testing::ToDouble(free.ray);
    const double near_clip = field.near_clip, length = free.length;
    const double opacity =
        OpacityBefore(field.geometry->frame, view, d.density.data(), ray, near_clip, length);
    OpacityBeforeAdjoint(field.geometry->frame, view, d.density.data(), ray, near_clip, length,
                         opacity, 0.5 / kDrawn,
                         [&](int32_t v, double g) { plain[static_cast<size_t>(v)] += g; });
  }
  DeviceFreeSpace free_space(rays);
  for (const bool exact_sums : {false, true}) {
    DeviceGrid grid = UploadGrid(MakeFastGrid(field), true, {}, exact_sums);
    DeviceTouched touched(grid);
    free_space.Accumulate(grid, kSeed, kStep, kDrawn, 0.5f, &touched);
    free_space.Join();
    const Buffer<float> gradient = DownloadGradient(grid);
    double largest = 0, worst = 0;
    const int lanes = RecordLanes(basis());
    for (int64_t v = 0; v < field.geometry->cells.num_vertices(); ++v) {
      largest = std::max(largest, std::abs(plain[static_cast<size_t>(v)]));
      worst = std::max(worst, std::abs(gradient[v * lanes + DensityLane(basis())] -
                                       plain[static_cast<size_t>(v)]));
    }
    EXPECT_GT(largest, 0);
    Row("gradient of free space", basis(),
        exact_sums ? "plain double, exact sums" : "plain double", worst / largest, 1e-4);
  }
}

// Cells, sources and values are those of the host, bit for bit.
TEST_P(DeviceCellsTest, ChangesEqualTheHosts) {
  const RadianceField field = RandomCellField({3, 2, 2}, 3, basis(), 61);
  FastGrid host = MakeFastGrid(field);
  host.density_rate = Buffer<float>(host.num_voxels());
  for (int64_t v = 0; v < host.num_voxels(); ++v)
    host.density_rate[v] = static_cast<float>(v % 5) / 5;
  Buffer<float> moment(host.records.size());
  for (int64_t i = 0; i < moment.size(); ++i) moment[i] = static_cast<float>(i % 11);
  std::vector<CellChange> change;
  for (int64_t c = 0; c < host.cells().num_cells(); ++c)
    change.push_back(c % 4 == 0   ? CellChange::kRemove
                     : c % 4 == 1 ? CellChange::kSplit
                                  : CellChange::kKeep);
  const DeviceGrid device = ChangeCellsOnDevice(UploadGrid(host, true, moment), change);
  const FastGrid down = DownloadGrid(device);
  const Buffer<float> down_moment = DownloadSecondMoment(device);
  ApplyChanges(change, &host, &moment);
  const auto same = [](const auto& a, const auto& b) {
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), static_cast<size_t>(a.size()) * sizeof(a[0])) == 0;
  };
  EXPECT_TRUE(same(down.cells().key, host.cells().key));
  EXPECT_TRUE(same(down.cells().level, host.cells().level));
  EXPECT_TRUE(same(down.cells().corner, host.cells().corner));
  EXPECT_TRUE(same(down.cells().vertex_key, host.cells().vertex_key));
  EXPECT_TRUE(same(down.cells().top, host.cells().top));
  EXPECT_TRUE(same(down.cells().nodes, host.cells().nodes));
  double error = 0;  // blends may be contracted
  for (int64_t i = 0; i < host.records.size(); ++i)
    error = std::max(error, std::abs(double{down.records[i]} - host.records[i]));
  for (int64_t i = 0; i < moment.size(); ++i)
    error = std::max(error, std::abs(double{down_moment[i]} - moment[i]) / 11);
  for (int64_t i = 0; i < host.density_rate.size(); ++i)
    error = std::max(error, std::abs(double{down.density_rate[i]} - host.density_rate[i]));
  Row("values of changed cells", basis(), "host", error, 1e-5);
}

TEST_P(DeviceCellsTest, StatisticsEqualTheHosts) {
  const RadianceField field = RandomCellField({3, 3, 3}, 2, basis(), 71);
  const FastGrid host = MakeFastGrid(field);
  std::vector<Image> photos;
  std::vector<TrainingView> views;
  photos.reserve(3);
  for (int i = 0; i < 3; ++i) {
    Camera camera;
    camera.width = 41;
    camera.height = 31;
    camera.fx = camera.fy = 40 + 10 * i;
    camera.cx = 20;
    camera.cy = 15;
    camera.camera_from_world.translation = {0.1 * i, 0.05, 2.5};
    photos.emplace_back(41, 31, 3);
    for (size_t p = 0; p < photos.back().pixels.size(); ++p)
      photos.back().pixels[p] =
          p % 3 == 0 && p % 77 == 0 ? std::nanf("") : static_cast<float>(p % 7) / 7;
    views.push_back({camera, &photos.back()});
  }
  const TrainingRays rays(views);
  const MarchOptions march{0.5f, 1e-3f};
  const CellStatistics plain = MeasureCells(host, rays, march, 2);
  const CellStatistics device =
      MeasureCellsOnDevice(UploadGrid(host), rays.ToDevice(), march, 2);
  double weight = 0, pixels = 0, error = 0, total = 0;
  for (int64_t c = 0; c < host.cells().num_cells(); ++c) {
    weight = std::max(weight, std::abs(double{plain.weight[c]} - device.weight[c]));
    // A weight at the limit may count on one side only.
    if (std::abs(plain.weight[c] - kSeenWeight) > 1e-5f)
      pixels = std::max(pixels, std::abs(double{plain.pixels[c]} - device.pixels[c]) /
                                    std::max(1.0f, plain.pixels[c]));
    error +=
        std::abs(static_cast<double>(plain.error[c]) - static_cast<double>(device.error[c]));
    total += static_cast<double>(plain.error[c]);
  }
  Row("weights of cells", basis(), "host", weight, 2e-5);
  Row("widths of cells in pixels", basis(), "host", pixels, 1e-3);
  Row("errors of cells", basis(), "host", error / total, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(AllBases, DeviceCellsTest, ::testing::Values(1, 4, 9),
                         [](const auto& info) { return "basis" + std::to_string(info.param); });

}  // namespace
}  // namespace regrade
