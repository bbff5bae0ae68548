#include "pipeline/study/prediction.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/report/cost_rows.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/stages/film_frames.h"
#include "reconstruct/fit/choose_degree.h"

namespace regrade {
namespace {

// The units of a stage's time; its parameters change the first one.
struct StageUnits {
  const char* stage;
  std::vector<const char*> units;
  const char* benchmark;  // its measurements determine the costs; "": the run's records do
  std::vector<const char*> parameters;
};

std::vector<StageUnits> UnitsOf(const RunSettings& settings) {
  const FitKind& kind = FitKindOf(settings);
  return {
      {"pose", {"photo megapixels"}, "", {}},
      {"reconstruct", {kind.work_unit}, "fit", {kind.work_options[0], kind.work_options[1]}},
      {"style_2d", {"staged pixels"}, "", {}},
      {"stylize", {"style rays", "photo pixels"}, "style", {"style-steps"}},
      {"render", {"frame pixels"}, "", {}},
      {"evaluate", {"pair pixels"}, "", {}},
  };
}

int64_t PixelsOf(const CaptureView& view, const RunSettings& settings) {
  const Camera camera = WorkingCamera(view.camera, settings.scene.photo_size, {}, {});
  return int64_t{camera.width} * camera.height;
}

double PhotoPixels(const RunSettings& settings, const Capture& capture) {
  int64_t pixels = 0;
  for (const CaptureView& view : capture.views) pixels += PixelsOf(view, settings);
  return static_cast<double>(pixels);
}

// A measured time and the amount of each unit.
struct Observation {
  std::vector<double> amounts;
  double seconds = 0, cpu_seconds = 0;
};

// The non-negative factors f that minimise sum_i (sum_k f_k a_ik / y_i - 1)^2, for one or two
// units.
std::vector<double> LeastSquares(const std::vector<Observation>& observations,
                                 double Observation::*time) {
  const size_t units = observations[0].amounts.size();
  double a00 = 0, a01 = 0, a11 = 0, b0 = 0, b1 = 0;
  for (const Observation& o : observations) {
    const double y = std::max(o.*time, 1e-9);
    const double x0 = o.amounts[0] / y, x1 = units > 1 ? o.amounts[1] / y : 0;
    a00 += x0 * x0, a01 += x0 * x1, a11 += x1 * x1, b0 += x0, b1 += x1;
  }
  const double first = a00 > 0 ? b0 / a00 : 0;
  if (units == 1) return {first};
  // With proportional observations the two factors are undetermined.
  const double determinant = a00 * a11 - a01 * a01;
  if (determinant > 1e-9 * a00 * a11) {
    const double f0 = (b0 * a11 - b1 * a01) / determinant;
    const double f1 = (b1 * a00 - b0 * a01) / determinant;
    if (f0 >= 0 && f1 >= 0) return {f0, f1};
    if (f0 < 0) return {0, a11 > 0 ? b1 / a11 : 0};
  }
  return {first, 0};
}

Observation ObservationOf(const StageUnits& stage, const RunSettings& settings,
                          const Capture& capture, double seconds, double cpu_seconds) {
  Observation observation{{}, seconds, cpu_seconds};
  for (const char* unit : stage.units)
    observation.amounts.push_back(AmountOf(unit, settings, capture));
  return observation;
}

// The base's settings with a variant's options.
RunSettings SettingsOf(const RunSettings& base, const Variant& variant) {
  RunSettings settings = base;
  OptionSet options;
  settings.Bind(&options);
  options.ApplyConfig(variant.options, "tradeoff");
  return settings;
}

// Of the frames that are only in the film, whose camera at working size is `common`.
double FilmPixels(const RunSettings& settings, const Capture& capture, const Camera& common) {
  const RenderOptions& render = settings.render;
  if (render.path.path == "views" || !render.films.films) return 0;
  double side = 0;  // of the photos' files
  for (const CaptureView& view : capture.views)
    side = std::max<double>(side, std::max(view.camera.width, view.camera.height));
  const double scale =
      std::min<double>(render.film_size, side) / std::max(common.width, common.height);
  return FilmFrames(render.film_seconds, render.fps) * scale * scale * common.width *
         common.height;
}

}  // namespace

FitPlace PlaceOf(const RunSettings& settings, const Capture& capture) {
  const std::vector<bool> held_out = HeldOutViews(capture, settings.run.holdout);
  FitPlace place;
  for (size_t i = 0; i < capture.views.size(); ++i)
    if (!held_out[i]) place.pixels += PixelsOf(capture.views[i], settings), ++place.photos;
  return place;
}

FitPlace ExpectedPlace(const RunSettings& settings, int64_t photos) {
  FitPlace place;
  place.pixels = ExpectedPixels(photos, settings.scene.photo_size, settings.run.holdout);
  place.photos = photos;
  return place;
}

double AmountOf(const std::string& unit, const RunSettings& settings, const Capture& capture) {
  const double photos = static_cast<double>(capture.views.size());
  const double pixels = PhotoPixels(settings, capture);
  const double film = CountSamples(settings.render);
  const double frame = photos > 0 ? pixels / photos : 0;
  if (unit == "photo megapixels") {
    double sum = 0;
    for (const CaptureView& view : capture.views) {
      const Camera camera = WorkingCamera(view.camera, settings.pose.image_size, {}, {});
      sum += 1e-6 * camera.width * camera.height;
    }
    return sum;
  }
  if (unit == "photo pixels") return pixels;
  if (unit == "trials") {
    const int fitted =
        static_cast<int>(WorkingViews(capture, settings.scene.photo_size, settings.run.holdout)
                             .Training()
                             .size());
    return settings.fit.sh_degree > 0 && fitted >= kLeastTrialViews &&
           settings.run.effects.find(kViewDependence) == std::string::npos;
  }
  if (unit == "staged pixels") {
    double sum = 0;
    for (const CaptureView& view : capture.views)
      sum += static_cast<double>(view.camera.width) * view.camera.height;
    return sum;
  }
  for (const FitKind* kind : FitKinds())
    if (unit == kind->work_unit) return kind->work(settings, PlaceOf(settings, capture));
  if (unit == "style rays")
    return static_cast<double>(settings.network.steps) *
           (settings.network.rays_per_step > 0 ? settings.network.rays_per_step : frame);
  if (unit == "frame pixels" || unit == "pair pixels") {
    if (capture.views.empty()) return 0;
    // Frames of the film, and of the views where they are compared with common intrinsics.
    const std::vector<Camera> views =
        WorkingViews(capture, settings.scene.photo_size, 0).Cameras();
    const Camera common = CommonCamera(views);
    const double common_frame = static_cast<double>(common.width) * common.height;
    if (unit == "frame pixels")
      return pixels + (film + (HaveSameIntrinsics(views) ? 0 : photos)) * common_frame +
             FilmPixels(settings, capture, common);
    double pairs = 0;
    for (const int gap : settings.consistency.gaps)
      pairs += std::max(0.0, photos - gap) + std::max(0.0, film - gap);
    return pairs * common_frame;
  }
  throw InputError("'" + unit + "' is not a unit of work");
}

std::vector<CostTerm> LearnCosts(const RunContext& run, const Capture& capture,
                                 const std::vector<Variant>& variants,
                                 const std::vector<Measurement>& measurements) {
  const RunSettings& base = run.settings;
  std::vector<CostTerm> costs;
  for (StageUnits stage : UnitsOf(base)) {
    const Workspace* const folder = IsOfScene(stage.stage) ? run.workspace : run.style;
    const auto record = folder == nullptr ? std::nullopt : folder->Find(stage.stage);
    // Photos with given poses are only read.
    if (stage.stage == std::string("pose") && record &&
        record->metrics.Find("colmap") == nullptr)
      stage.units = {"staged pixels"};
    std::vector<Observation> observations;
    for (const Measurement& m : measurements) {
      const bool relevant =
          m.parameter.empty() ||
          std::ranges::find(stage.parameters, m.parameter) != stage.parameters.end();
      if (m.benchmark != stage.benchmark || !relevant) continue;
      for (const Variant& variant : variants)
        if (variant.benchmark == m.benchmark && variant.parameter == m.parameter &&
            variant.value == m.value)
          observations.push_back(ObservationOf(stage, SettingsOf(base, variant), capture,
                                               m.seconds, m.cpu_seconds));
    }
    if (observations.empty() && record)
      observations.push_back(ObservationOf(stage, base, capture, record->seconds,
                                           record->cpu_seconds.value_or(record->seconds)));
    if (observations.empty()) continue;
    const std::vector<double> seconds = LeastSquares(observations, &Observation::seconds),
                              cpu = LeastSquares(observations, &Observation::cpu_seconds);
    for (size_t k = 0; k < stage.units.size(); ++k)
      costs.push_back({stage.stage, stage.units[k], seconds[k], cpu[k]});
    if (stage.stage == std::string("reconstruct") && record) {
      const double amount = AmountOf("staged pixels", base, capture);
      const Observation own = ObservationOf(stage, base, capture, 0, 0);
      const auto metric = [&record](const char* name) {
        const JsonValue* value = record->metrics.Find(name);
        return value != nullptr && value->IsNumber() ? value->AsDouble() : 0;
      };
      const CostTerm trial{stage.stage, "trials", metric("trial_seconds"),
                           metric("trial_cpu_seconds")};
      const auto rest = [&](double whole, double factor, double of_trial) {
        const double left = whole - factor * own.amounts[0] - of_trial;
        return amount > 0 ? std::max(0.0, left) / amount : 0;
      };
      if (trial.seconds > 0) costs.push_back(trial);
      costs.push_back(
          {stage.stage, "staged pixels", rest(record->seconds, seconds[0], trial.seconds),
           rest(record->cpu_seconds.value_or(record->seconds), cpu[0], trial.cpu_seconds)});
    }
  }
  return costs;
}

std::vector<StageTime> Predict(const std::vector<CostTerm>& costs, const RunSettings& settings,
                               const Capture& capture) {
  std::vector<StageTime> times;
  for (const CostTerm& term : costs) {
    for (const FitKind* kind : FitKinds())
      if (kind != &FitKindOf(settings) && term.unit == kind->work_unit)
        throw InputError(
            "the costs are of fits of another kind of field", "--costs",
            "measure them by `regrade tradeoff --field " + settings.scene.field + "`");
    auto at = std::ranges::find(times, term.stage, &StageTime::stage);
    if (at == times.end()) at = times.insert(times.end(), {term.stage, 0, 0});
    const double amount = AmountOf(term.unit, settings, capture);
    at->seconds += amount * term.seconds;
    at->cpu_seconds += amount * term.cpu_seconds;
  }
  return times;
}

JsonValue ToJson(const std::vector<CostTerm>& costs) {
  JsonValue::Array rows;
  for (const CostTerm& term : costs)
    rows.push_back(JsonValue::Object{{"stage", term.stage},
                                     {"unit", term.unit},
                                     {"seconds", term.seconds},
                                     {"cpu_seconds", term.cpu_seconds}});
  return rows;
}

std::vector<CostTerm> CostsFromJson(const JsonValue& json, const std::string& where) {
  CheckTradeoffSchema(json, where);
  try {
    std::vector<CostTerm> costs;
    for (const JsonValue& row : json.At("unit_costs").AsArray())
      costs.push_back({row.At("stage").AsString(), row.At("unit").AsString(),
                       row.At("seconds").AsDouble(), row.At("cpu_seconds").AsDouble()});
    return costs;
  } catch (const Error& error) {
    throw InputError(error.what_failed(), where,
                     "give a tradeoff.json from `regrade tradeoff`");
  }
}

}  // namespace regrade
