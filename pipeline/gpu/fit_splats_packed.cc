// regrade_gpu splats: a packed capture becomes splats, measured on the views that were kept
// back.
#include <cstdio>
#include <filesystem>

#include "evaluate/image_quality.h"
#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "kernels/image/undistort_photo.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/packed_capture.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/gpu/gpu_commands.h"
#include "pipeline/run/fit_memory.h"
#include "reconstruct/splats/fit_splats.h"
#include "reconstruct/splats/splat_engine.h"

namespace regrade {
namespace {

struct HeldOutMeans {
  double psnr = 0, ssim = 0;
  int count = 0;  // of views with an unmasked pixel
};

HeldOutMeans Measure(SplatEngine* engine, const PackedCapture& capture,
                     const std::string& frames) {
  HeldOutMeans means;
  int index = 0;
  if (!frames.empty()) std::filesystem::create_directories(frames);
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    const PackedView pinhole = PinholeView(view);
    const Image seen = engine->Render(pinhole.camera).color;
    if (!frames.empty()) WritePpm(Concat(frames, "/frame_", index++, ".ppm"), seen);
    const auto psnr = Psnr(seen, pinhole.photo), ssim = Ssim(seen, pinhole.photo);
    if (!psnr || !ssim) continue;
    means.psnr += *psnr;
    means.ssim += *ssim;
    ++means.count;
  }
  means.psnr /= std::max(means.count, 1);
  means.ssim /= std::max(means.count, 1);
  return means;
}

}  // namespace

PackedView PinholeView(PackedView view) {
  view.photo = UndistortPhoto(view.photo, view.camera);
  view.camera = view.camera.Undistorted();
  view.camera.ndc = {};
  return view;
}

void FitSplatsPacked(const FitSplatsOptions& settings, const SplatFitOptions& fit) {
  const double start = ClockSeconds();
  const PackedCapture capture = ReadPackedCapture(settings.capture);
  const Backend backend = settings.device == "cpu" ? Backend::kCpu : Backend::kCuda;
  std::vector<TrainingView> views;
  int64_t pixels = 0;
  for (const PackedView& view : capture.views) {
    if (view.held_out) continue;
    views.push_back({view.camera, &view.photo, view.points});
    views.back().camera.ndc = {};  // splats need no device coordinates
    pixels += view.photo.num_pixels();
  }
  SplatFitOptions options =
      SplatsWithinMemory(fit, {.backend = backend,
                               .pixels = pixels,
                               .photos = static_cast<int64_t>(views.size()),
                               .box = capture.scene.box})
          .options;
  options.seed = settings.seed;
  SplatFitHooks hooks;
  double last_note = 0;
  hooks.progress = [&](const Progress& progress) {
    if (ClockSeconds() - start - last_note > 5) {
      last_note = ClockSeconds() - start;
      std::fprintf(stderr, "%3.0f %%  %.0f s  %s\n", 100 * progress.done / progress.total,
                   last_note, progress.note.c_str());
    }
    return LoopControl::kContinue;
  };
  HeldOutMeans means;
  hooks.measure = [&](SplatEngine* engine) {
    means = Measure(engine, capture, settings.frames);
  };
  const double read_seconds = ClockSeconds() - start;
  const SplatFitResult result = FitSplats(views, capture.scene.box, options, hooks, backend);
  const SceneBox& box = capture.scene.box;
  if (!settings.out.empty())
    WriteFieldFile(settings.out, {FieldOfSplats(result.splats, {{}, box.center, box.radius},
                                                box.near_clip, result.fit_pixel),
                                  capture.scene.field_from_world,
                                  {}});
  JsonValue::Array curve;
  for (size_t i = 0; i < result.curve.size();
       i += std::max<size_t>(1, result.curve.size() / 100))
    curve.push_back(JsonValue::Array{result.curve[i].seconds, result.curve[i].psnr_train_db,
                                     result.curve[i].splats});
  const JsonValue record = JsonValue::Object{
      {"capture", settings.capture},
      {"device", backend == Backend::kCpu ? "cpu" : ReadDeviceStatus().name},
      {"steps", options.steps},
      {"splats", result.splats.count()},
      {"seconds_read", read_seconds},
      {"seconds_steps", result.seconds},
      {"seconds_all", ClockSeconds() - start},
      {"rejected", result.rejected},
      {"entries_per_step", result.entries_per_step},
      {"psnr_train_db", result.psnr_train_db},
      {"psnr_heldout_db", means.count > 0 ? JsonValue(means.psnr) : JsonValue()},
      {"ssim_heldout", means.count > 0 ? JsonValue(means.ssim) : JsonValue()},
      {"device_memory", DevicePeakBytes()},
      {"curve_train", std::move(curve)}};
  std::printf("%s\n", DumpJson(record, -1).c_str());
}

}  // namespace regrade
