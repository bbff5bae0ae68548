#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/stages/field_fit.h"
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
    std::vector<std::string> sentences = {NoteOfAdapting(settings_.fit, options_)};
    PlannedFit fit = FitWithinMemory(options_, place_);
    options_ = std::move(fit.options);
    sentences.push_back(fit.notice);
    sentences.push_back("the fit will take " + PlanText(fit.plan));
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
    if (place_.box.spheres) report->background_texels = field.geometry->spheres.num_texels();
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

}  // namespace

std::unique_ptr<FieldFit> MakeVoxelFit(const RunSettings& settings, const FitPlace& place) {
  return std::make_unique<VoxelFit>(settings, place);
}

}  // namespace regrade
