// Gathers how much of each frame few photos see.
#pragma once

#include <utility>
#include <vector>

#include "evaluate/seen_by_few.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/stages/film_frames.h"

namespace regrade {

// The frames at the photos' positions must come first. Of a long film only some frames are
// looked at, evenly spaced.
class SeenByFewRecorder {
 public:
  // `near`: as of SeenByFew. Keeps a reference to `views`.
  SeenByFewRecorder(const WorkingViews& views, double near) : views_(views), near_(near) {}

  // Whether that frame is one of those that are looked at.
  static bool LooksAt(const FrameSet& set, int index);
  // The sample of such a frame, for Add.
  SampledView Sample(const FrameSet& set, int index, const Image& depth) const;

  // The next frame that is looked at.
  void Add(SampledView view) { current_.push_back(std::move(view)); }
  // After the last frame of a set.
  void Finish(const FrameSet& set);
  const SeenByFewMetrics& metrics() const { return metrics_; }

 private:
  void SetFilm(const std::vector<Metric>& shares, int stride);

  const WorkingViews& views_;
  const double near_;
  std::vector<SampledView> photos_, current_;
  SeenByFewMetrics metrics_;
};

}  // namespace regrade
