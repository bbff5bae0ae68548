// regrade_gpu fit: a packed capture becomes a field, measured on the views that were kept back.
#include <chrono>
#include <cmath>
#include <numeric>

#include "evaluate/image_quality.h"
#include "kernels/field/device/device_rays.h"
#include "kernels/field/fast_rays.h"
#include "kernels/field/render.h"
#include "pipeline/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/gpu/gpu_commands.h"
#include "pipeline/packed_capture.h"
#include "reconstruct/fit_field.h"

namespace regrade {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + static_cast<long>(middle), values.end());
  return values[middle];
}

struct HeldOut {
  std::vector<double> psnr, ssim;
  double render_ms = 0;  // median of a view's kernel, rays on the device already
};

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(std::max<size_t>(values.size(), 1));
}

HeldOut MeasureHeldOut(const RadianceField& field, const PackedCapture& capture,
                       const MarchOptions& march) {
  const DeviceGrid grid = UploadGrid(MakeFastGrid(field));
  HeldOut result;
  std::vector<double> milliseconds;
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    Buffer<Ray> rays(view.photo.num_pixels());
    for (int y = 0; y < view.camera.height; ++y)
      for (int x = 0; x < view.camera.width; ++x)
        rays[int64_t{y} * view.camera.width + x] = view.camera.PixelRay(x, y);
    const int64_t n = rays.size();
    const DeviceBuffer<Ray> device_rays = DeviceBuffer<Ray>::Of(rays, "rays");
    DeviceBuffer<Vec3f> color(n, "colours");
    DeviceBuffer<float> depth(n, "depths"), transmittance(n, "transmittances");
    for (int repeat = 0; repeat < 6; ++repeat) {
      DeviceWait("rendering");
      const auto start = Clock::now();
      RenderOnDevice(grid, device_rays.data(), n, march,
                     {color.data(), depth.data(), transmittance.data()});
      DeviceWait("rendering");
      if (repeat > 0) milliseconds.push_back(1e3 * SecondsSince(start));
    }
    Image image(view.camera.width, view.camera.height, 3);
    DeviceCopyOut(image.pixels.data(), color.data(), n * 12);
    for (float& value : image.pixels) value = std::clamp(value, 0.0f, 1.0f);
    if (const auto value = Psnr(image, view.photo)) result.psnr.push_back(*value);
    if (const auto value = Ssim(image, view.photo)) result.ssim.push_back(*value);
  }
  result.render_ms = Median(milliseconds);
  return result;
}

}  // namespace

void FitPacked(const FitPackedOptions& settings, const FitOptions& options) {
  const auto start = Clock::now();
  const PackedCapture capture = ReadPackedCapture(settings.capture);
  std::vector<TrainingView> views;
  for (const PackedView& view : capture.views)
    if (!view.held_out) views.push_back({view.camera, &view.photo});
  const double read_seconds = SecondsSince(start);
  const auto fit_start = Clock::now();
  const Backend backend = settings.device == "cpu" ? Backend::kCpu : Backend::kCuda;
  const FitResult fit = FitField(views, capture.scene.box, options, {}, backend);
  const double fit_seconds = SecondsSince(fit_start);
  const HeldOut measured = MeasureHeldOut(fit.field, capture, {options.step});
  if (!settings.field.empty())
    WriteFieldFile(settings.field, {fit.field, capture.scene.field_from_world, capture.scene.ndc});

  JsonValue::Array curve;
  for (size_t i = 0; i < fit.curve.size(); i += std::max<size_t>(1, fit.curve.size() / 100))
    curve.push_back(JsonValue::Array{fit.curve[i].seconds, fit.curve[i].psnr_train_db});
  const DeviceStatus device = ReadDeviceStatus();
  const JsonValue record = JsonValue::Object{
      {"capture", settings.capture},
      {"device", settings.device == "cpu" ? "cpu" : device.name},
      {"seconds_read", read_seconds},
      {"seconds_fit", fit_seconds},
      {"seconds_all", SecondsSince(start)},
      {"rays", fit.rays},
      {"samples", fit.samples},
      {"rejected_voxels", fit.rejected_voxels},
      {"voxels", fit.field.geometry->num_voxels()},
      {"psnr_train_db", fit.psnr_train_db},
      {"psnr_heldout_db", Mean(measured.psnr)},
      {"ssim_heldout", Mean(measured.ssim)},
      {"render_ms", measured.render_ms},
      {"curve_train", std::move(curve)}};
  std::printf("%s\n", DumpJson(record, -1).c_str());
  std::fflush(stdout);
}

}  // namespace regrade
