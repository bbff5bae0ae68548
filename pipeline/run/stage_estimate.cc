#include "pipeline/run/stage_estimate.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/plan.h"

namespace regrade {
namespace {

// Seconds with two threads (AMD EPYC) for a million pixels: of files that are decoded, of
// photos that the 2D method styles, of frames with both fields and the 2D method, and
// of compared pairs; and of a report with its page.
constexpr double kDecode = 0.03, kStyle2d = 0.17, kFrame = 2.3, kPair = 0.55, kReport = 3;
constexpr double kAroundFit = 1.16;        // the trial of degrees, pruning and measuring
constexpr double kOfResidual = 1.5;        // of frames at the photos' places
constexpr double kFasterOnCard = 1.0 / 8;  // training and frames, roughly

double Scaled(double seconds, int threads) { return seconds * 2 / std::max(threads, 1); }

// Megapixels of a photo whose longer side is at most `longest`.
double Megapixels(const CaptureSize& size, int longest) {
  const double scale = std::min(1.0, double(longest) / std::max({1, size.width, size.height}));
  return 1e-6 * size.width * size.height * scale * scale;
}

double PoseSeconds(const CaptureSize& size, int threads) {
  const double photos = static_cast<double>(size.photos);
  const double decode = Scaled(kDecode * photos * Megapixels(size, 1 << 20), threads);
  if (!size.placed) return decode + PlanPoses(size.photos, threads).seconds;
  return decode + (size.lacks_points ? PlanTracks(size.photos, threads).seconds : 0);
}

FitPlace PlaceOf(const RunSettings& settings, const CaptureSize& size, Backend backend) {
  return {backend, PixelsToFit(settings, size), PhotosToFit(settings, size)};
}

double RenderSeconds(const RunSettings& settings, const CaptureSize& size) {
  const RenderOptions& render = settings.render;
  const double photo = Megapixels(size, settings.scene.photo_size);
  double views = static_cast<double>(size.photos) * photo, film = 0;
  if (render.path.path != "views") {
    views += photo *
             static_cast<double>(SamplesOfFilm(render.film_seconds, render.fps).moments.size());
    film = FilmFrames(render.film_seconds, render.fps) * Megapixels(size, render.film_size);
  }
  return kFrame * views + FitKindOf(settings).film_frame * film;
}

double EvaluateSeconds(const RunSettings& settings, const CaptureSize& size) {
  const RenderOptions& render = settings.render;
  double pairs = 0;
  for (const int gap : settings.consistency.gaps) {
    pairs += std::max<double>(0, static_cast<double>(size.photos) - gap);
    if (render.path.path != "views")
      pairs += std::max<double>(
          0, std::ssize(SamplesOfFilm(render.film_seconds, render.fps).moments) - gap);
  }
  return kPair * pairs * Megapixels(size, settings.scene.photo_size);
}

// Of --max-memory; what is free changes from one moment to the next.
FitInMemory WithinGivenMemory(const RunSettings& settings, FitPlace place) {
  if (settings.run.max_memory_gb > 0) {
    place.max_memory_gb = settings.run.max_memory_gb;
    try {
      return Lowered(settings, place);
    } catch (const Error&) {  // MemoryWarning says so
    }
  }
  return {place, settings, ""};
}

}  // namespace

CaptureSize SizeOfCapture(const Capture& capture) {
  CaptureSize size;
  size.photos = std::ssize(capture.views);
  size.placed = true;
  if (capture.views.empty()) return size;
  // The photo in the middle by its number of pixels.
  std::vector<std::pair<int64_t, const Camera*>> cameras;
  for (const CaptureView& view : capture.views)
    cameras.emplace_back(int64_t{view.camera.width} * view.camera.height, &view.camera);
  std::ranges::nth_element(cameras, cameras.begin() + std::ssize(cameras) / 2);
  const Camera& middle = *cameras[cameras.size() / 2].second;
  size.width = middle.width, size.height = middle.height;
  return size;
}

int64_t PhotosToFit(const RunSettings& settings, const CaptureSize& size) {
  const int holdout = settings.run.holdout;
  return size.photos - (holdout > 0 ? (size.photos + holdout - 1) / holdout : 0);
}

int64_t PixelsToFit(const RunSettings& settings, const CaptureSize& size) {
  return std::llround(1e6 * Megapixels(size, settings.scene.photo_size) *
                      static_cast<double>(PhotosToFit(settings, size)));
}

std::vector<StageEstimate> EstimateStages(const RunSettings& settings, const CaptureSize& size,
                                          Backend backend, int threads) {
  const double on_card = backend == Backend::kCuda ? kFasterOnCard : 1;
  const double photo = Megapixels(size, settings.scene.photo_size),
               photos = static_cast<double>(size.photos);
  const FitInMemory within = WithinGivenMemory(settings, PlaceOf(settings, size, backend));
  const FitKind& kind = FitKindOf(settings);
  const StagePlan fit = kind.plan(within.settings, within.place);
  StagePlan stylize = PlanStyle(settings.network, kind.field(within.settings, within.place),
                                1e6 * photo, photos, threads);
  if (settings.residual.On())
    stylize.seconds += Scaled(kOfResidual * kFrame * photos * photo, threads);
  return {
      {"pose", PoseSeconds(size, threads)},
      {"reconstruct", kAroundFit * fit.seconds, fit.memory},
      {"style_2d",
       Scaled(photos * (kDecode * Megapixels(size, 1 << 20) + kStyle2d * photo), threads)},
      {"stylize", on_card * stylize.seconds, stylize.memory},
      {"render", on_card * Scaled(RenderSeconds(settings, size), threads)},
      {"evaluate", Scaled(EvaluateSeconds(settings, size), threads)},
      {"report", Scaled(kReport, threads)},
  };
}

double MeasuredPace(const std::vector<StageEstimate>& estimates,
                    const std::vector<StageEstimate>& measured) {
  double estimated = 0, took = 0;
  for (const StageEstimate& stage : measured)
    for (const StageEstimate& estimate : estimates)
      if (estimate.stage == stage.stage) estimated += estimate.seconds, took += stage.seconds;
  return estimated > 0 && took > 0 ? std::clamp(took / estimated, 0.25, 4.0) : 1;
}

double SecondsOf(const std::vector<StageEstimate>& estimates, const std::string& first,
                 const std::string& last) {
  double seconds = 0;
  bool within = false;
  for (const StageEstimate& estimate : estimates) {
    within = within || estimate.stage == first;
    if (within) seconds += estimate.seconds;
    if (estimate.stage == last) break;
  }
  return seconds;
}

}  // namespace regrade
