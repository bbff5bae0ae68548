// Runs and times one variant with the same fit and stages as a run.
#pragma once

#include <memory>
#include <string>

#include "pipeline/run/run_context.h"
#include "pipeline/study/measurements.h"

namespace regrade {

class VariantRunner {
 public:
  // `base` must have been run in base->workspace, to "evaluate" with a style and to
  // "reconstruct" without. Each measurement creates `folder` and removes it.
  VariantRunner(RunContext* base, const std::string& folder);
  ~VariantRunner();

  // Each repetition uses another seed, so that the spread of accuracy includes the seed's.
  // Throws Interrupted, and what the stages throw.
  Measurement Measure(const Variant& variant, int repeat, const ProgressFunction& progress);

 private:
  struct Photos;  // read once, for the benchmark "fit"
  struct Frames;  // rendered once, for the benchmarks "render" and "flow"

  void MeasurePoses(const Variant& variant, const ProgressFunction& progress, Measurement* m);
  void MeasureFit(const Variant& variant, const ProgressFunction& progress, Measurement* m);
  void MeasureStyle(const Variant& variant, const ProgressFunction& progress, Measurement* m);
  void MeasureRender(const Variant& variant, Measurement* m);
  void MeasureFlow(const Variant& variant, Measurement* m);
  const Photos& PhotosAt(int size);
  const Frames& BaseFrames();

  RunContext* base_;
  std::string folder_;
  std::unique_ptr<Photos> photos_;
  std::unique_ptr<Frames> frames_;
};

}  // namespace regrade
