// How long a view takes to render.
#include <vector>

#include "evaluate/image_quality.h"
#include "kernels/base/clock.h"
#include "kernels/base/quantile.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/image/detail_kept.h"
#include "kernels/splats/cuda/device_splat_renderer.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/gpu/gpu_commands.h"

namespace regrade {
double RenderMilliseconds(const DeviceGrid& grid, const PackedCapture& capture,
                          const MarchOptions& march, const FastFrames& fast) {
  std::vector<double> milliseconds;
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    const Camera camera = view.camera.Undistorted();
    const int64_t n = view.photo.num_pixels();
    DeviceBuffer<Vec3f> color(n, "colours");
    DeviceBuffer<float> depth(n, "depths"), transmittance(n, "transmittances");
    for (int repeat = 0; repeat < 6; ++repeat) {
      DeviceWait("rendering");
      const double start = ClockSeconds();
      RenderFrameOnDevice(grid, camera, march,
                          {color.data(), depth.data(), transmittance.data()}, fast);
      DeviceWait("rendering");
      if (repeat > 0) milliseconds.push_back(1e3 * (ClockSeconds() - start));
    }
  }
  return Median(milliseconds);
}

namespace {

struct Setting {
  float stop, opacity_step, step;
  bool half;  // the copy in half precision
};

std::vector<Setting> SettingsOf(float step) {
  const float coarse = 2 * step;
  return {{1e-4f, 0, step, false},          {1e-3f, 0, step, false},
          {1e-2f, 0, step, false},          {1e-3f, 1.0f / 256, step, false},
          {1e-3f, 1.0f / 128, step, false}, {1e-3f, 1.0f / 64, step, false},
          {1e-3f, 1.0f / 32, step, false},  {1e-2f, 1.0f / 64, step, false},
          {1e-3f, 0, coarse, false},        {1e-4f, 0, step, true},
          {1e-3f, 0, step, true},           {1e-3f, 1.0f / 64, step, true},
          {1e-2f, 1.0f / 64, step, true},   {1e-2f, 1.0f / 32, step, true},
          {1e-3f, 0, coarse, true},         {1e-2f, 1.0f / 64, coarse, true}};
}

}  // namespace

JsonValue RenderCosts(const DeviceGrid& grid, const PackedCapture& capture, float step) {
  const HalfGrid half = MakeHalfGrid(grid);
  std::vector<Image> exact;
  JsonValue::Array rows;
  for (const Setting& setting : SettingsOf(step)) {
    const MarchOptions march{setting.step, setting.stop};
    const FastFrames fast{.opacity_step = setting.opacity_step,
                          .half = setting.half ? &half : nullptr};
    std::vector<double> against_exact, against_photo, ssim, detail_kept;
    size_t index = 0;
    for (const PackedView& view : capture.views) {
      if (!view.held_out) continue;
      const Image image = RenderViewOnDevice(grid, view.camera, march, fast).color;
      if (rows.empty()) exact.push_back(image);
      against_exact.push_back(Psnr(image, exact[index++]).value_or(0));
      against_photo.push_back(Psnr(image, view.photo).value_or(0));
      ssim.push_back(Ssim(image, view.photo).value_or(0));
      detail_kept.push_back(MeasureFineDetail(image, view.photo).kept.value_or(0));
    }
    rows.push_back(
        JsonValue::Object{{"stop", setting.stop},
                          {"opacity_step", setting.opacity_step},
                          {"step", setting.step},
                          {"half", setting.half},
                          {"ms", RenderMilliseconds(grid, capture, march, fast)},
                          {"db_against_first", rows.empty() ? 0.0 : Median(against_exact)},
                          {"db_against_photos", Median(against_photo)},
                          {"ssim_against_photos", Median(ssim)},
                          {"detail_kept_against_photos", Median(detail_kept)}});
  }
  return rows;
}

namespace {

// The median over the held-out views, as of RenderMilliseconds.
double SplatMilliseconds(const RadianceField& field, const PackedCapture& capture) {
  DeviceSplats splats;
  splats.Upload(SplatsOf(field));
  DeviceSplatRenderer renderer;
  std::vector<double> milliseconds;
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    for (int repeat = 0; repeat < 6; ++repeat) {
      DeviceWait("rendering");
      const double start = ClockSeconds();
      renderer.Render(splats.view(), view.camera, SplatOptionsOf(field));
      DeviceWait("rendering");
      if (repeat > 0) milliseconds.push_back(1e3 * (ClockSeconds() - start));
    }
  }
  return Median(milliseconds);
}

}  // namespace

JsonValue RenderCosts(const RadianceField& field, const PackedCapture& capture) {
  if (!field.geometry->splats.on())
    return RenderCosts(UploadGrid(MakeFastGrid(field)), capture, field.march.step);
  const FieldRenderer renderer(field, Backend::kCuda);
  std::vector<double> against_photo, ssim, detail_kept;
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    const Image image = renderer.Render(view.camera).color;
    against_photo.push_back(Psnr(image, view.photo).value_or(0));
    ssim.push_back(Ssim(image, view.photo).value_or(0));
    detail_kept.push_back(MeasureFineDetail(image, view.photo).kept.value_or(0));
  }
  return JsonValue::Array{
      JsonValue::Object{{"ms", SplatMilliseconds(field, capture)},
                        {"db_against_photos", Median(against_photo)},
                        {"ssim_against_photos", Median(ssim)},
                        {"detail_kept_against_photos", Median(detail_kept)}}};
}

}  // namespace regrade
