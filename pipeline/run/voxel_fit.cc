#include "pipeline/run/voxel_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/run/paper_config.h"
#include "reconstruct/fit/adapt_options.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {
namespace {

class VoxelFit : public FieldFit {
 public:
  VoxelFit(const RunSettings& settings, const FitPlace& place)
      : settings_(settings), place_(place), options_(AdaptedTo(settings.fit, place)) {
    options_.seed = settings.run.seed;
    if (settings.run.reproducible && options_.shards == 0)
      options_.shards = kReproducibleShards;
  }

  std::vector<std::string> FitIntoMemory() override {
    PlannedFit fit = FitWithinMemory(options_, place_);
    options_ = std::move(fit.options);
    std::vector<std::string> sentences = {fit.notice,
                                          "the fit will take " + PlanText(fit.plan)};
    std::erase(sentences, "");
    return sentences;
  }

  int sh_degree() const override { return options_.sh_degree; }
  void LimitDegree(int degree) override {
    options_.sh_degree = std::min(options_.sh_degree, degree);
  }

  std::optional<DegreeTrial> TryHarmonics(const std::vector<TrainingView>& views,
                                          const ProgressFunction& progress) override {
    return TryDegrees(views, place_.box, options_, progress, place_.backend);
  }

  bool UseCheckpoint(std::string_view bytes, std::string* note) override {
    resume_ = UnpackFitState(bytes, note);
    return resume_.has_value();
  }

  FittedField Run(const std::vector<TrainingView>& views, const FieldFitHooks& of) override {
    FitHooks hooks;
    hooks.progress = of.progress;
    if (of.checkpoint)
      hooks.checkpoint = [&of](const FitState& state) {
        of.checkpoint(PackFitState(state, of.note).Pieces());
      };
    hooks.resume = resume_ ? &*resume_ : nullptr;
    FitResult fit = FitField(views, place_.box, options_, hooks, place_.backend);
    FittedField fitted{
        std::move(fit.field), fit.psnr_train_db, {}, fit.rays, fit.rejected_voxels};
    for (const FitCurvePoint& point : fit.curve)
      if (std::isfinite(point.psnr_train_db))
        fitted.psnr_at_steps.emplace_back(point.step, RoundedForChart(point.psnr_train_db));
    return fitted;
  }

  void Describe(const RadianceField& field, ReconstructReport* report) const override {
    report->finest_grid = *std::ranges::max_element(options_.resolutions);
    report->sh_degree = options_.sh_degree;
    report->voxels = field.geometry->num_voxels();
    if (place_.box.far_surroundings)
      report->background_texels = field.geometry->spheres.num_texels();
    if (report->paper_config.empty()) return;
    RunSettings used = settings_;
    used.fit = options_;
    const std::string paper = report->paper_config.substr(0, report->paper_config.find(':'));
    report->not_to_the_letter = NotToTheLetter(paper, DecidedValues(used));
  }

 private:
  RunSettings settings_;
  FitPlace place_;
  FitOptions options_;
  std::optional<FitState> resume_;
};

JsonValue Numbers(const std::vector<int>& values) {
  return JsonValue::Array(values.begin(), values.end());
}

std::vector<int> Scaled(std::vector<int> values, double factor, int least) {
  for (int& value : values)
    value = std::max(least, static_cast<int>(std::lround(value * factor)));
  return values;
}

JsonValue OptionsOfVoxels(const RunSettings& settings) { return OptionValues(settings.fit); }

int DegreeOfVoxels(const RunSettings& settings) { return settings.fit.sh_degree; }

void CheckVoxelSettings(const RunSettings&) {}

StagePlan PlanVoxels(const RunSettings& settings, const FitPlace& place) {
  return PlanFitAt(place, AdaptedTo(settings.fit, place));
}

PlannedField PlannedGrid(const RunSettings& settings, const FitPlace& place) {
  return PlanField(AdaptedTo(settings.fit, place), place.box);
}

std::string LowerVoxels(const FitPlace& place, RunSettings* settings) {
  PlannedFit fit = FitWithinMemory(AdaptedTo(settings->fit, place), place);
  settings->fit = std::move(fit.options);
  return fit.notice;
}

std::vector<MeasuredOption> MeasuredOfVoxels(const RunSettings& settings) {
  const FitOptions& fit = settings.fit;
  const auto steps = [&](double factor) { return Numbers(Scaled(fit.steps, factor, 1)); };
  const auto grids = [&](double factor) {
    return Numbers(Scaled(fit.resolutions, factor, 16));
  };
  const float step = fit.step, stop = fit.stop_transmittance;
  return {
      {"fit", "fit-steps", steps(1), {steps(0.25), steps(0.5), steps(1), steps(2)}},
      {"fit", "fit-resolutions", grids(1), {grids(0.67), grids(1), grids(1.33)}},
      {"fit", "fit-step-size", step, {2 * step, step, 0.5 * step}},
      {"fit", "fit-stop", stop, {1e-2, 1e-3, 1e-4, 1e-6}},
      {"fit", "sh-degree", fit.sh_degree, {0, 1, 2}},
      // Neither end is the accurate one: errors are relative to the base.
      {"fit", "fit-view-bound", fit.view_bound, {0.1, 0.2, 0.4, 1e6}, false},
      // 4: sums do not depend on the number of threads.
      {"fit", "fit-shards", fit.shards, {0, 4}},
      // Ray marching, which has no options in a run: exact frames use the field's own.
      {"render", "ray-stop", nullptr, {1e-2, 1e-3, 0.0}},
      {"render", "ray-step", nullptr, {2.0, 0.5}},
  };
}

std::unique_ptr<FieldFit> MakeVoxelFit(const RunSettings& settings, const FitPlace& place) {
  return std::make_unique<VoxelFit>(settings, place);
}

}  // namespace

const FitKind kVoxelFit{.name = "voxels",
                        .film_frame = 2.1,
                        .options = OptionsOfVoxels,
                        .sh_degree = DegreeOfVoxels,
                        .check = CheckVoxelSettings,
                        .plan = PlanVoxels,
                        .field = PlannedGrid,
                        .lower = LowerVoxels,
                        .measured = MeasuredOfVoxels,
                        .make = MakeVoxelFit};

}  // namespace regrade
