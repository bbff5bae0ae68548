#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/splats/splat_field.h"
#include "pipeline/fields/splat_checkpoint.h"
#include "pipeline/stages/field_fit.h"
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
    FittedField fitted{
        FieldOfSplats(fit.splats, box, place_.box.near_clip, options_.antialiased),
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

}  // namespace

std::unique_ptr<FieldFit> MakeSplatFit(const RunSettings& settings, const FitPlace& place) {
  return std::make_unique<SplatFit>(settings, place);
}

}  // namespace regrade
