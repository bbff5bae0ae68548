// regrade_gpu render --compare: the film's fast renderer and its variants against the exact
// one, on all training views and along a film. Renderers take turns at each frame, so that they
// meet the same clock and temperature of the card.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/image_quality.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/render/field_renderer.h"
#include "kernels/render/voxel_renderer.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/gpu/gpu_commands.h"

namespace regrade {
namespace {

using Clock = std::chrono::steady_clock;

// Stands for frames that are the same bits.
constexpr double kMostDb = 200;

struct Variant {
  const char* name;
  bool half;  // the copy in half precision
  float stop, opacity_step;
  std::vector<double> views_db = {}, film_db = {};  // before rounding to 8 bits
  std::vector<double> kernel_ms = {};               // from the camera to pixels on the device
  std::vector<double> frame_ms = {};                // to pixels on the host
};

// The first one is exact, the second one the film's.
std::vector<Variant> Variants() {
  const float exact = MarchOptions().stop_transmittance;
  return {{"exact", false, exact, 0},
          {"fast", true, kFastStop, kFastOpacityStep},
          {"half", true, exact, 0},
          {"half, stop 1e-3", true, 1e-3f, 0},
          {"stop 1e-3, steps 1/64", false, 1e-3f, 1.0f / 64},
          {"half, stop 1e-3, steps 1/256", true, 1e-3f, 1.0f / 256},
          {"half, stop 1e-3, steps 1/64", true, 1e-3f, 1.0f / 64},
          {"half, stop 1e-4, steps 1/64", true, 1e-4f, 1.0f / 64},
          {"half, stop 1e-3, steps 1/32", true, 1e-3f, 1.0f / 32}};
}

double MillisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

template <typename T>
int64_t Bytes(const DeviceBuffer<T>& buffer) {
  return buffer.size() * static_cast<int64_t>(sizeof(T));
}
int64_t Bytes(const DeviceGrid& grid) {
  return Bytes(grid.links) + Bytes(grid.dense_density) + Bytes(grid.empty_distance) +
         Bytes(grid.vertex_of_voxel) + Bytes(grid.records);
}
int64_t Bytes(const HalfGrid& half) {
  return Bytes(half.links) + Bytes(half.density_pairs) + Bytes(half.empty_distance) +
         Bytes(half.records);
}

double Quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(fraction * static_cast<double>(values.size() - 1))];
}

class Comparison {
 public:
  Comparison(const DeviceGrid& grid, float step)
      : grid_(grid), half_(MakeHalfGrid(grid)), step_(step), variants_(Variants()) {}

  void AddView(const Camera& camera) { Add(camera, &Variant::views_db, ""); }
  // `folder`: for pictures exact/`picture` and fast/`picture`; empty: none.
  void AddFrame(const Camera& camera, const std::string& folder, const std::string& picture) {
    Add(camera, &Variant::film_db, folder.empty() ? "" : folder + "/", picture);
  }

  JsonValue Report() const {
    JsonValue::Array rows;
    for (const Variant& variant : variants_)
      rows.push_back(JsonValue::Object{{"name", variant.name},
                                       {"half", variant.half},
                                       {"stop", variant.stop},
                                       {"opacity_step", variant.opacity_step},
                                       {"views_db_min", Quantile(variant.views_db, 0)},
                                       {"views_db_median", Quantile(variant.views_db, 0.5)},
                                       {"film_db_min", Quantile(variant.film_db, 0)},
                                       {"film_db_median", Quantile(variant.film_db, 0.5)},
                                       {"kernel_ms", Quantile(variant.kernel_ms, 0.5)},
                                       {"frame_ms", Quantile(variant.frame_ms, 0.5)}});
    return JsonValue::Object{{"views", static_cast<int64_t>(variants_[0].views_db.size())},
                             {"film_frames", static_cast<int64_t>(variants_[0].film_db.size())},
                             {"grid_bytes", Bytes(grid_)},
                             {"copy_bytes", Bytes(half_)},
                             {"least_db_of_fast", LeastOfFast()},
                             {"renderers", std::move(rows)}};
  }

 private:
  double LeastOfFast() const {
    return std::min(Quantile(variants_[1].views_db, 0), Quantile(variants_[1].film_db, 0));
  }
  FastFrames FastOf(const Variant& variant) const {
    return {.opacity_step = variant.opacity_step, .half = variant.half ? &half_ : nullptr};
  }
  void TimeKernel(const Camera& camera, Variant* variant) {
    const int64_t n = int64_t{camera.width} * camera.height;
    const DeviceBuffer<Vec3f> color(n, "colours");
    const DeviceBuffer<float> depth(n, "depths"), transmittance(n, "transmittances");
    DeviceWait("rendering");
    const auto start = Clock::now();
    RenderFrameOnDevice(grid_, camera, {step_, variant->stop},
                        {color.data(), depth.data(), transmittance.data()}, FastOf(*variant));
    DeviceWait("rendering");
    variant->kernel_ms.push_back(MillisecondsSince(start));
  }
  void Add(const Camera& camera, std::vector<double> Variant::*errors,
           const std::string& folder, const std::string& picture = "") {
    const int count = static_cast<int>(variants_.size());
    std::vector<Image> images(variants_.size());
    // Each frame begins with another renderer.
    for (int k = 0; k < count; ++k) {
      const size_t at = static_cast<size_t>((k + turn_) % count);
      Variant& variant = variants_[at];
      const auto start = Clock::now();
      images[at] =
          RenderViewOnDevice(grid_, camera, {step_, variant.stop}, FastOf(variant)).color;
      variant.frame_ms.push_back(MillisecondsSince(start));
      TimeKernel(camera, &variant);
    }
    ++turn_;
    for (size_t at = 0; at < images.size(); ++at)
      (variants_[at].*errors)
          .push_back(std::min(kMostDb, Psnr(images[at], images[0]).value_or(kMostDb)));
    if (folder.empty()) return;
    WritePpm(folder + "exact/" + picture, images[0]);
    WritePpm(folder + "fast/" + picture, images[1]);
  }

  const DeviceGrid& grid_;
  HalfGrid half_;
  float step_;
  std::vector<Variant> variants_;
  int turn_ = 0;
};

}  // namespace

JsonValue CompareRenderers(const DeviceGrid& grid, const PackedCapture& capture, float step,
                           const RenderPackedOptions& settings) {
  std::vector<Camera> cameras;  // half precision is for rays without distortion
  for (const PackedView& view : capture.views) cameras.push_back(view.camera.Undistorted());
  if (!settings.frames.empty())
    for (const char* renderer : {"/exact", "/fast"})
      std::filesystem::create_directories(settings.frames + renderer);
  Comparison(grid, step).AddView(cameras[0]);  // the first frames of a process are slower
  Comparison comparison(grid, step);
  for (size_t i = 0; i < cameras.size(); ++i)
    if (!capture.views[i].held_out) comparison.AddView(cameras[i]);
  const std::vector<Camera> film =
      MakeCameraPath(cameras, {.path = "smooth"}, EvenMoments(settings.path_frames));
  for (size_t i = 0; i < film.size(); ++i) {
    char name[16];
    std::snprintf(name, sizeof name, "%05d.ppm", static_cast<int>(i));
    comparison.AddFrame(film[i], settings.frames, name);
  }
  return comparison.Report();
}

}  // namespace regrade
