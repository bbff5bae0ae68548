// regrade_gpu fit: a packed capture becomes a field, measured on the views that were kept back.
#include <algorithm>
#include <filesystem>
#include <numeric>

#include "evaluate/image_quality.h"
#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render.h"
#include "kernels/image/detail_kept.h"
#include "pipeline/capture/packed_capture.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/gpu/gpu_commands.h"
#include "pipeline/run/fit_memory.h"
#include "pipeline/run/paper_config.h"
#include "reconstruct/fit/adapt_options.h"
#include "reconstruct/fit/fit_engine.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {
namespace {

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(std::max<size_t>(values.size(), 1));
}

struct HeldOut {
  double psnr = 0, ssim = 0;
  JsonValue detail_kept, detail_error;  // null without a view that has fine detail
  double transmittance = 0;             // what the field lets through, of all that is seen
};

// Writes the views' pictures to `frames`, unless it is empty.
HeldOut MeasureHeldOut(FitEngine* engine, const PackedCapture& capture,
                       const MarchOptions& march, const std::string& frames) {
  std::vector<double> psnr, ssim, kept, error, transmittance;
  int index = 0;
  if (!frames.empty()) std::filesystem::create_directories(frames);
  for (const PackedView& view : capture.views) {
    if (!view.held_out) continue;
    const RenderedView seen = engine->Render(view.camera, march);
    if (!frames.empty()) WritePpm(Concat(frames, "/frame_", index++, ".ppm"), seen.color);
    if (const auto value = Psnr(seen.color, view.photo)) psnr.push_back(*value);
    if (const auto value = Ssim(seen.color, view.photo)) ssim.push_back(*value);
    const FineDetail detail = MeasureFineDetail(seen.color, view.photo);
    if (detail.kept) kept.push_back(*detail.kept);
    if (detail.levels) error.push_back(*detail.levels);
    transmittance.insert(transmittance.end(), seen.transmittance.pixels.begin(),
                         seen.transmittance.pixels.end());
  }
  const auto mean = [](const std::vector<double>& values) {
    return values.empty() ? JsonValue() : JsonValue(Mean(values));
  };
  return {Mean(psnr), Mean(ssim), mean(kept), mean(error), Mean(transmittance)};
}

// The configuration of --preset paper, which sets the fit's options. What it decides of the
// scene was decided by `regrade pack`.
std::string ChoosePaper(const FitPackedOptions& settings, const PackedCapture& capture,
                        OptionSet* bound) {
  const SceneBox& box = capture.scene.box;
  const bool llff = capture.scene.ndc.on(),
             syn = !llff && !box.far_surroundings && box.background;
  if (!llff && !syn && !box.far_surroundings)
    throw UsageError("was packed without --preset paper", settings.capture,
                     "pack it with --preset paper and the same --paper-config");
  const PaperChoice choice = ChoosePaperConfig(settings.paper_config, {syn, llff});
  ApplyPaperChoice(choice, bound);
  return choice.name;
}

// The fit's and those with which the capture was packed.
JsonValue::Array DifferencesTo(const std::string& paper, const FitOptions& options,
                               const PackedCapture& capture) {
  JsonValue values = OptionValues(options);
  JsonValue::Array differences;
  if (capture.decided.empty()) {
    differences.push_back("the capture does not say how its box was decided: pack it again");
  } else {
    const JsonValue decided = ParseJson(capture.decided, "decided");
    for (const auto& [option, value] : decided.AsObject()) values[option] = value;
  }
  for (std::string& difference : NotToTheLetter(paper, values))
    differences.push_back(std::move(difference));
  return differences;
}

// The options for this capture, lowered to memory, which is reported; checkpoints are of those
// that were asked for.
FitOptions OptionsForCapture(const FitPackedOptions& settings, const FitOptions& asked,
                             const PackedCapture& capture, Backend backend) {
  int64_t pixels = 0;
  for (const PackedView& view : capture.views)
    if (!view.held_out) pixels += view.photo.num_pixels();
  const FitOptions adapted = AdaptOptions(asked, {backend == Backend::kCuda, pixels});
  PlannedFit fit = FitWithinMemory(adapted, {.backend = backend,
                                             .pixels = pixels,
                                             .box = capture.scene.box,
                                             .max_memory_gb = settings.max_memory_gb,
                                             .reproducible = settings.reproducible});
  if (!fit.notice.empty()) std::fprintf(stderr, "%s\n", fit.notice.c_str());
  return fit.options;
}

// What a fit depends on: a checkpoint of another one is not continued.
std::string IdentityOf(const FitPackedOptions& settings, const FitOptions& options) {
  return DumpJson(
      JsonValue::Object{
          {"capture", std::filesystem::path(settings.capture).filename().string()},
          {"bytes", static_cast<int64_t>(std::filesystem::file_size(settings.capture))},
          {"options", OptionValues(options)},
          {"seed", options.seed}},
      -1);
}

std::optional<FitState> ReadFitCheckpoint(const std::string& path,
                                          const std::string& identity) {
  if (!std::filesystem::is_regular_file(path)) return std::nullopt;
  constexpr uint64_t kMost = uint64_t{1} << 36;
  std::string note;
  std::optional<FitState> state = UnpackFitState(ReadWholeFile(path, kMost), &note);
  if (!state) throw InputError("is no checkpoint of a fit", path, "remove it");
  if (note != identity)
    throw InputError("is the checkpoint of a fit with another capture or other options", path,
                     "give the same ones, or another --checkpoint");
  return state;
}

}  // namespace

void FitPacked(const FitPackedOptions& settings, const FitOptions& fit_options,
               OptionSet* bound) {
  const double start = ClockSeconds();
  const PackedCapture capture = ReadPackedCapture(settings.capture);
  std::string paper;
  if (settings.preset == "paper") paper = ChoosePaper(settings, capture, bound);
  const Backend backend = settings.device == "cpu" ? Backend::kCpu : Backend::kCuda;
  FitOptions asked = fit_options;
  asked.seed = settings.seed;
  const FitOptions options = OptionsForCapture(settings, asked, capture, backend);
  std::vector<TrainingView> views;
  for (const PackedView& view : capture.views)
    if (!view.held_out) views.push_back({view.camera, &view.photo, view.points});
  const double read_seconds = ClockSeconds() - start;
  const double fit_start = ClockSeconds();
  FitHooks hooks;
  std::optional<FitState> resume;
  if (!settings.checkpoint.empty()) {
    const std::string identity = IdentityOf(settings, asked);
    resume = ReadFitCheckpoint(settings.checkpoint, identity);
    hooks.checkpoint = [&settings, identity](const FitState& state) {
      WriteFileAtomically(settings.checkpoint, PackFitState(state, identity).Pieces());
    };
  }
  if (resume) hooks.resume = &*resume;
  double last_note = 0;
  hooks.progress = [&](const Progress& progress) {
    if (ClockSeconds() - fit_start - last_note > 5) {
      last_note = ClockSeconds() - fit_start;
      std::fprintf(stderr, "%3.0f %%  %.0f s  %s\n", 100 * progress.done / progress.total,
                   last_note, progress.note.c_str());
    }
    return settings.stop_after > 0 && ClockSeconds() - start > settings.stop_after
               ? LoopControl::kStop
               : LoopControl::kContinue;
  };
  HeldOut measured;
  JsonValue::Array stages;
  hooks.keep_field = !settings.out.empty();
  hooks.measure = [&](FitEngine* engine) {
    const double seconds = ClockSeconds() - fit_start;
    measured = MeasureHeldOut(engine, capture, MarchOfField(options), settings.frames);
    stages.push_back(
        JsonValue::Array{seconds, measured.psnr, measured.ssim, measured.detail_kept});
  };
  const FitResult fit = FitField(views, capture.scene.box, options, hooks, backend);
  const double fit_seconds = ClockSeconds() - fit_start;
  JsonValue render;
  if (hooks.keep_field) {
    WriteFieldFile(settings.out,
                   {fit.field, capture.scene.field_from_world, capture.scene.ndc});
    if (backend == Backend::kCuda) {
      const DeviceGrid grid = UploadGrid(MakeFastGrid(fit.field));
      render = RenderCosts(grid, capture, options.step);
    }
  }

  JsonValue::Array curve;
  for (size_t i = 0; i < fit.curve.size(); i += std::max<size_t>(1, fit.curve.size() / 100))
    curve.push_back(JsonValue::Array{fit.curve[i].seconds, fit.curve[i].psnr_train_db});
  const JsonValue::Array differences =
      paper.empty() ? JsonValue::Array() : DifferencesTo(paper, options, capture);
  const DeviceStatus device = ReadDeviceStatus();
  const JsonValue record =
      JsonValue::Object{{"capture", settings.capture},
                        {"device", settings.device == "cpu" ? "cpu" : device.name},
                        {"paper_config", paper.empty() ? JsonValue() : JsonValue(paper)},
                        {"not_to_the_letter", differences},
                        {"finest_grid", std::ranges::max(options.resolutions)},
                        {"seconds_read", read_seconds},
                        {"seconds_fit", fit_seconds},
                        {"seconds_steps", fit.seconds},
                        {"seconds_all", ClockSeconds() - start},
                        {"rays", fit.rays},
                        {"samples", fit.samples},
                        {"rejected_voxels", fit.rejected_voxels},
                        {"voxels", fit.voxels},
                        {"psnr_train_db", fit.psnr_train_db},
                        {"psnr_heldout_db", measured.psnr},
                        {"ssim_heldout", measured.ssim},
                        {"detail_kept_heldout", measured.detail_kept},
                        {"detail_error_heldout", measured.detail_error},
                        {"transmittance_heldout", measured.transmittance},
                        {"device_memory", DevicePeakBytes()},
                        {"render", std::move(render)},
                        {"curve_heldout", std::move(stages)},
                        {"curve_train", std::move(curve)}};
  std::printf("%s\n", DumpJson(record, -1).c_str());
  std::fflush(stdout);
}

}  // namespace regrade
