// regrade_gpu style: restyles a packed capture's field after its style picture.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evaluate/fidelity.h"
#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "kernels/field/field_kind.h"
#include "kernels/image/undistort_photo.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/gpu/gpu_commands.h"
#include "stylize/image/color_transfer.h"
#include "stylize/training/restyle_field.h"

namespace regrade {
namespace {

// Seconds since the last call, or since it was made.
class Stopwatch {
 public:
  double Lap() {
    const double begin = last_;
    last_ = ClockSeconds();
    return last_ - begin;
  }

 private:
  double last_ = ClockSeconds();
};

// 0 where a photo does not reach, and the photo filled there; empty where it is whole.
Image MaskAndFill(Image* photo) {
  Image mask(photo->width, photo->height, 1);
  bool whole = true;
  for (int64_t i = 0; i < photo->num_pixels(); ++i) {
    const bool reaches = std::isfinite(photo->pixels[static_cast<size_t>(3 * i)]);
    mask.pixels[static_cast<size_t>(i)] = reaches ? 1.0f : 0.0f;
    whole = whole && reaches;
  }
  if (whole) return {};
  FillBeyond(photo);
  return mask;
}

// What MKL makes of the views that the field was fitted to.
TrainingTargets StyleViews(const PackedCapture& capture) {
  TrainingTargets targets;
  const std::unique_ptr<ViewStylizer> method = MakeColorTransfer(StyleOptions(), capture.style);
  for (size_t i = 0; i < capture.views.size(); ++i) {
    const PackedView& view = capture.views[i];
    if (view.held_out) continue;
    Image photo = view.photo;
    Image mask = MaskAndFill(&photo);
    targets.Add({.camera = view.camera, .name = view.file}, photo,
                method->Stylize(photo, static_cast<int>(i)), std::move(mask));
  }
  return targets;
}

std::vector<Image> HeldOutFrames(const FieldRenderer& renderer, const PackedCapture& capture) {
  std::vector<Image> frames;
  for (const PackedView& view : capture.views)
    if (view.held_out) frames.push_back(renderer.Render(view.camera).color);
  return frames;
}

FrameSource SourceOf(const std::vector<Image>& frames) {
  return {static_cast<int>(frames.size()), [&frames](int i) { return frames[i]; }};
}

// Held-out frames of the restyled field beside what the 2D method makes of the unstyled ones.
JsonValue MeasureHeldOutFidelity(const std::vector<Image>& unstyled,
                                 const std::vector<Image>& styled, const Image& style) {
  const std::unique_ptr<ViewStylizer> method = MakeColorTransfer(StyleOptions(), style);
  std::vector<Image> of_2d;
  for (size_t i = 0; i < unstyled.size(); ++i)
    of_2d.push_back(method->Stylize(unstyled[i], static_cast<int>(i)));
  FidelityTargets targets{.views_2d = SourceOf(of_2d), .unstyled = SourceOf(unstyled)};
  const FidelityRow row = MeasureFidelity({"styled", SourceOf(styled)}, targets);
  const auto value = [](const std::optional<double>& v) {
    return v ? JsonValue(*v) : JsonValue();
  };
  return JsonValue::Object{{"psnr_to_2d_db", value(row.psnr_to_2d_db)},
                           {"structure", value(row.structure)},
                           {"hue_std", value(row.hue_std)},
                           {"hue_std_2d", value(row.hue_std_2d)},
                           {"chroma", value(row.chroma)},
                           {"chroma_2d", value(row.chroma_2d)}};
}

// Renders the held-out views and measures frame times. `unstyled`: its frames before.
void MeasureFrames(const RadianceField& field, const PackedCapture& capture,
                   const std::vector<Image>& unstyled, const std::string& frames,
                   JsonValue* record) {
  {
    const FieldRenderer renderer(field, Backend::kCuda);
    Stopwatch watch;
    const auto first = std::ranges::find_if(capture.views, &PackedView::held_out);
    if (first != capture.views.end()) renderer.Render(first->camera);
    (*record)["seconds_first_frame"] = watch.Lap();
    if (!unstyled.empty())
      (*record)["held_out"] =
          MeasureHeldOutFidelity(unstyled, HeldOutFrames(renderer, capture), capture.style);
    if (!frames.empty()) RenderHeldOut(renderer, capture, frames, "styled");
  }
  (*record)["render"] = RenderCosts(field, capture);
}

}  // namespace

void StylePacked(const StylePackedOptions& settings, const TrainNetworkOptions& options) {
  Stopwatch watch;
  StoredField stored = ReadFieldFile(settings.field);
  const PackedCapture capture = ReadCaptureFor(stored.field, settings.capture);
  if (capture.style.num_pixels() == 0)
    throw InputError("holds no style picture", settings.capture,
                     "pack it with --style PICTURE");
  const int64_t voxels = stored.field.geometry->num_voxels();
  JsonValue record = JsonValue::Object{{"capture", settings.capture}};
  record["seconds_read"] = watch.Lap();
  const TrainingTargets targets = StyleViews(capture);
  record["seconds_2d"] = watch.Lap();
  RestyleRequest request;
  request.options = options;
  request.options.seed = settings.seed;
  request.backend = settings.device == "cuda" ? Backend::kCuda : Backend::kCpu;
  const bool on_device = request.backend == Backend::kCuda;
  std::vector<Image> unstyled;
  if (on_device) {
    const FieldRenderer renderer(stored.field, Backend::kCuda);
    unstyled = HeldOutFrames(renderer, capture);
    if (!settings.frames.empty()) RenderHeldOut(renderer, capture, settings.frames, "source");
  }
  watch.Lap();

  int64_t free_before = 0, least_free = 0;  // bytes on the device, beside the field
  Stopwatch steps;
  double seconds_start = 0, seconds_steps = 0;
  int reports = 0;
  RestyleHooks hooks;
  hooks.finished = [&](RestyleHooks::Part part) {
    const char* const names[] = {"seconds_upload", "seconds_learn", "seconds_restyle"};
    record[names[static_cast<int>(part)]] = watch.Lap();
    const double since_last_step = steps.Lap();
    if (part == RestyleHooks::Part::kTraining) record["seconds_conclusion"] = since_last_step;
    if (on_device && part == RestyleHooks::Part::kUpload)
      free_before = least_free = ReadDeviceStatus().free_bytes;
  };
  hooks.training.progress = [&](const Progress&) {
    (reports++ == 0 ? seconds_start : seconds_steps) += steps.Lap();
    if (on_device && reports % 4 == 1)
      least_free = std::min(least_free, ReadDeviceStatus().free_bytes);
    return LoopControl::kContinue;
  };
  const RestyledField restyled = Restyle(std::move(stored.field), targets, request, hooks);
  const TrainNetworkResult& trained = restyled.trained;
  if (!settings.network.empty())
    WriteNetworkFile(settings.network,
                     {trained.network, trained.k_est, restyled.styled.background});
  if (!settings.styled.empty())
    WriteFieldFile(settings.styled, {restyled.styled, stored.field_from_world, stored.ndc});
  record["seconds_start_and_first_steps"] = seconds_start;
  record["seconds_other_steps"] = seconds_steps;
  if (on_device) MeasureFrames(restyled.styled, capture, unstyled, settings.frames, &record);
  record["device"] = on_device ? ReadDeviceStatus().name : "cpu";
  record[KindOf(*restyled.styled.geometry).name] = voxels;
  record["steps"] = trained.steps;
  record["mean_touched_voxels"] = trained.mean_touched_voxels;
  record["mib_beyond_the_field"] = static_cast<double>(free_before - least_free) / (1 << 20);
  record["psnr_to_2d_db"] = trained.psnr_db;
  record["linear_map_psnr_db"] = trained.linear_map_psnr_db;
  record["k_est"] = trained.k_est;
  if (!trained.history.bounds.empty()) record["first_bound"] = trained.history.bounds.front();
  record["bound"] = trained.bound;
  record["local_lipschitz_sampled"] = trained.local_lipschitz_sampled;
  std::printf("%s\n", DumpJson(record, -1).c_str());
  std::fflush(stdout);
}

}  // namespace regrade
