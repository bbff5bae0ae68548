// The fit of a scene's field to pictures; FitKind makes one of the kind that --field names.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "pipeline/report/stage_metrics.h"
#include "reconstruct/fit/choose_degree.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

struct FieldFitHooks {
  ProgressFunction progress;
  // Gets the pieces of a state that UseCheckpoint takes; may be empty.
  std::function<void(const std::vector<std::string_view>&)> checkpoint;
  std::string note;  // stored in checkpoints
};

struct FittedField {
  RadianceField field;
  double psnr_train_db = 0;
  Curve psnr_at_steps;
  int64_t rays = 0;      // pixels that were compared
  int64_t rejected = 0;  // updates of records with a gradient that was not finite
};

class FieldFit {
 public:
  virtual ~FieldFit() = default;

  // Lowers the options to what fits into memory; sentences for the console, the plan last.
  // Throws Error(kResources).
  virtual std::vector<std::string> FitIntoMemory() = 0;
  virtual int sh_degree() const = 0;
  virtual void LimitDegree(int degree) = 0;
  // A trial of harmonics on held-out views; empty where this kind needs none.
  virtual std::optional<DegreeTrial> TryHarmonics(const std::vector<TrainingView>& views,
                                                  const ProgressFunction& progress) = 0;
  // Continues from a checkpoint's bytes, with its note; false if they are of another fit.
  virtual bool UseCheckpoint(std::string_view bytes, std::string* note) = 0;
  // Once.
  virtual FittedField Run(const std::vector<TrainingView>& views,
                          const FieldFitHooks& hooks) = 0;
  // The options that were used, and the field's size.
  virtual void Describe(const RadianceField& field, ReconstructReport* report) const = 0;
};

// To a thousandth, for charts.
double RoundedForChart(double value);

}  // namespace regrade
