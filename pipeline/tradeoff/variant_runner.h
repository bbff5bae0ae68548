// Measures one variant: the same fit and the same stages that a run does, with a clock beside
// them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pipeline/run/run_context.h"
#include "pipeline/tradeoff/measurements.h"

namespace regrade {

class VariantRunner {
 public:
  // `base` has been run, in base->workspace, to "evaluate" where a style was given and to
  // "reconstruct" otherwise. `folder` is made for each variant and removed behind it.
  VariantRunner(RunContext* base, const std::string& folder);
  ~VariantRunner();

  // Each repetition draws anew, so that the spread of accuracy is a seed's. Throws Interrupted,
  // and what the stages throw.
  Measurement Measure(const Variant& variant, int repeat, const ProgressFunction& progress);

 private:
  struct Photos;  // read once, for the plane "fit"
  struct Frames;  // rendered once, for the planes "render" and "flow"

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
