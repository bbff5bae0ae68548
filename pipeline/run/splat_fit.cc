#include "pipeline/run/splat_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/effect_words.h"
#include "pipeline/fields/splat_checkpoint.h"
#include "reconstruct/splats/fit_splats.h"

namespace regrade {
namespace {

class SplatFit : public FieldFit {
 public:
  SplatFit(const RunSettings& settings, const FitPlace& place)
      : place_(place), options_(settings.splats) {
    options_.seed = settings.run.seed;
  }

  std::vector<std::string> FitIntoMemory() override {
    PlannedSplatFit fit = SplatsWithinMemory(options_, place_);
    options_ = fit.options;
    std::vector<std::string> sentences = {fit.notice,
                                          "the fit will take " + PlanText(fit.plan)};
    std::erase(sentences, "");
    return sentences;
  }

  int sh_degree() const override { return options_.sh_degree; }
  void LimitDegree(int degree) override {
    options_.sh_degree = std::min(options_.sh_degree, degree);
  }
  std::optional<DegreeTrial> TryHarmonics(const std::vector<TrainingView>&,
                                          const ProgressFunction&) override {
    return std::nullopt;
  }

  bool UseCheckpoint(std::string_view bytes, std::string* note) override {
    resume_ = UnpackSplatFitState(bytes, note);
    return resume_.has_value();
  }

  FittedField Run(const std::vector<TrainingView>& views, const FieldFitHooks& of) override {
    SplatFitHooks hooks;
    hooks.progress = of.progress;
    if (of.checkpoint)
      hooks.checkpoint = [&of](const SplatFitState& state) {
        of.checkpoint(PackSplatFitState(state, of.note).Pieces());
      };
    hooks.resume = resume_ ? &*resume_ : nullptr;
    const SplatFitResult fit = FitSplats(views, place_.box, options_, hooks, place_.backend);
    const GridFrame box{{}, place_.box.center, place_.box.radius};
    FittedField fitted{FieldOfSplats(fit.splats, box, place_.box.near_clip, fit.fit_pixel),
                       fit.psnr_train_db,
                       {},
                       fit.pixels,
                       fit.rejected};
    for (const SplatCurvePoint& point : fit.curve)
      if (std::isfinite(point.psnr_train_db))
        fitted.psnr_at_steps.emplace_back(point.step, RoundedForChart(point.psnr_train_db));
    return fitted;
  }

  void Describe(const RadianceField& field, ReconstructReport* report) const override {
    report->sh_degree = options_.sh_degree;
    report->splats = field.geometry->num_voxels();
  }

 private:
  FitPlace place_;
  SplatFitOptions options_;
  std::optional<SplatFitState> resume_;
};

JsonValue OptionsOfSplats(const RunSettings& settings) { return OptionValues(settings.splats); }

int DegreeOfSplats(const RunSettings& settings) { return settings.splats.sh_degree; }

// What belongs to voxels alone.
void CheckSplatSettings(const RunSettings& settings) {
  if (settings.run.preset == "paper")
    throw UsageError("the paper's field has voxels", "--field splats and --preset paper",
                     "leave one of them out");
  const auto effects = ParseEffects(settings.run.effects);
  if (const auto ndc = effects.find("ndc"); ndc != effects.end() && ndc->second)
    throw UsageError("belongs to voxels", "--effects ndc=on",
                     "leave it out, or use --field voxels");
}

StagePlan PlanSplats(const RunSettings& settings, const FitPlace& place) {
  return PlanSplatsAt(place, AtMostOfPixels(settings.splats, place));
}

PlannedField PlannedSplatField(const RunSettings& settings, const FitPlace& place) {
  return PlanField(AtMostOfPixels(settings.splats, place));
}

std::string LowerSplats(const FitPlace& place, RunSettings* settings) {
  PlannedSplatFit fit = SplatsWithinMemory(settings->splats, place);
  settings->splats = fit.options;
  return fit.notice;
}

std::vector<MeasuredOption> MeasuredOfSplats(const RunSettings& settings) {
  const SplatFitOptions& splats = settings.splats;
  const auto steps = [&](double factor) {
    return JsonValue(std::max(1, static_cast<int>(std::lround(splats.steps * factor))));
  };
  const auto most = [&](float factor) { return factor * splats.thousands; };
  return {
      {"fit", "splat-steps", splats.steps, {steps(0.25), steps(0.5), steps(1), steps(2)}},
      {"fit", "splats", splats.thousands, {most(0.25f), most(0.5f), most(1), most(2)}},
      {"fit", "splat-degree", splats.sh_degree, {0, 1, 2}},
  };
}

std::unique_ptr<FieldFit> MakeSplatFit(const RunSettings& settings, const FitPlace& place) {
  return std::make_unique<SplatFit>(settings, place);
}

}  // namespace

const FitKind kSplatFit{.name = "splats",
                        .film_frame = 0.75,
                        .options = OptionsOfSplats,
                        .sh_degree = DegreeOfSplats,
                        .check = CheckSplatSettings,
                        .plan = PlanSplats,
                        .field = PlannedSplatField,
                        .lower = LowerSplats,
                        .measured = MeasuredOfSplats,
                        .make = MakeSplatFit};

}  // namespace regrade
