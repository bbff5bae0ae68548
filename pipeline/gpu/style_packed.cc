// regrade_gpu style: a packed capture's field learns the colours of its style picture.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/image/color_statistics.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/gpu/gpu_commands.h"
#include "stylize/cuda/device_style.h"
#include "stylize/field/apply_network.h"
#include "stylize/image/color_transfer.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

using Clock = std::chrono::steady_clock;

// Seconds since the last call, or since it was made.
class Stopwatch {
 public:
  double Lap() {
    const auto now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  Clock::time_point last_ = Clock::now();
};

// What the 2D method made of the views that the field was fitted to.
struct StyleTargets {
  std::vector<Image> targets;
  std::vector<StyledTrainingView> views;
  SceneColorMap scene_map;
};

StyleTargets StyleViews(const PackedCapture& capture) {
  StyleTargets style_targets;
  style_targets.targets.reserve(capture.views.size());
  const std::unique_ptr<ViewStylizer> method = MakeColorTransfer(StyleOptions(), capture.style);
  std::vector<ColorStatistics> before, after;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    const PackedView& view = capture.views[i];
    if (view.held_out) continue;
    style_targets.targets.push_back(method->Stylize(view.photo, static_cast<int>(i)));
    style_targets.views.push_back(
        {view.camera, &style_targets.targets.back(), nullptr, view.file});
    before.push_back(MeasureColor(view.photo));
    after.push_back(MeasureColor(style_targets.targets.back()));
  }
  const MklMap mkl = ComputeMkl(Pool(before), Pool(after));
  style_targets.scene_map = {mkl.map, mkl.norm};
  return style_targets;
}

}  // namespace

void StylePacked(const StylePackedOptions& settings, const TrainNetworkOptions& options) {
  Stopwatch watch;
  const PackedCapture capture = ReadPackedCapture(settings.capture);
  if (capture.style.num_pixels() == 0)
    throw Error(ExitCode::kInput, "holds no style picture", settings.capture,
                "pack it with --style PICTURE");
  StoredField stored = ReadFieldFile(settings.field);
  const MarchOptions march{stored.field.step};
  JsonValue record = JsonValue::Object{{"capture", settings.capture}};
  record["seconds_read"] = watch.Lap();
  const StyleTargets style_targets = StyleViews(capture);
  record["seconds_2d"] = watch.Lap();
  const Vec3d background = style_targets.scene_map.map(stored.field.background.Cast<double>());
  for (int c = 0; c < 3; ++c)
    stored.field.background[c] = static_cast<float>(std::clamp(background[c], 0.0, 1.0));

  const bool on_device = settings.device == "cuda";
  DeviceGrid grid;
  if (on_device) grid = UploadGrid(MakeFastGrid(stored.field));
  const int64_t free_before = ReadDeviceStatus().free_bytes;
  int64_t least_free = free_before;
  record["seconds_upload"] = watch.Lap();
  if (on_device && !settings.frames.empty())
    RenderHeldOut(grid, capture, march, settings.frames, "source");
  watch.Lap();
  TrainingHooks hooks;
  Stopwatch steps;
  double seconds_start = 0, seconds_steps = 0;
  int reports = 0;
  hooks.progress = [&](const Progress&) {
    (reports++ == 0 ? seconds_start : seconds_steps) += steps.Lap();
    if (on_device && reports % 4 == 1)
      least_free = std::min(least_free, ReadDeviceStatus().free_bytes);
    return LoopControl::kContinue;
  };
  const TrainNetworkResult trained =
      TrainNetwork(stored.field, style_targets.views, style_targets.scene_map, march, options,
                   hooks, nullptr, on_device ? &grid : nullptr);
  record["seconds_learn"] = watch.Lap();
  record["seconds_start_and_first_steps"] = seconds_start;
  record["seconds_other_steps"] = seconds_steps;
  if (on_device)
    RestyleOnDevice(trained.network, &grid);
  else
    stored.field.appearance = ApplyNetwork(trained.network, stored.field);
  record["seconds_restyle"] = watch.Lap();
  if (on_device) {
    const auto first = std::find_if(capture.views.begin(), capture.views.end(),
                                    [](const PackedView& view) { return view.held_out; });
    if (first != capture.views.end()) RenderViewOnDevice(grid, first->camera, march);
    record["seconds_first_frame"] = watch.Lap();
    record["render"] = RenderCosts(grid, capture, march.step);
    if (!settings.frames.empty())
      RenderHeldOut(grid, capture, march, settings.frames, "styled");
  }
  record["device"] = on_device ? ReadDeviceStatus().name : "cpu";
  record["voxels"] = stored.field.geometry->num_voxels();
  record["steps"] = trained.steps;
  record["mean_touched_voxels"] = trained.mean_touched_voxels;
  record["mib_beyond_the_field"] = static_cast<double>(free_before - least_free) / (1 << 20);
  record["psnr_to_2d_db"] = trained.psnr_db;
  record["linear_map_psnr_db"] = trained.linear_map_psnr_db;
  record["k_est"] = trained.k_est;
  record["bound"] = trained.bound;
  record["local_lipschitz_sampled"] = trained.local_lipschitz_sampled;
  std::printf("%s\n", DumpJson(record, -1).c_str());
  std::fflush(stdout);
}

}  // namespace regrade
