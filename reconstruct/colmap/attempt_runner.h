// One attempt to find poses with COLMAP: extracts, matches, maps, reads the models, and adjusts
// the best one, with time limits and progress.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_output.h"
#include "reconstruct/colmap/photo_statuses.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/colmap/refine_intrinsics.h"

namespace regrade {

class AttemptRunner {
 public:
  // Creates `work_folder`, which receives databases and logs. `report` gets COLMAP's version
  // and notes. The arguments outlive the object. Throws as PosesFromPhotos.
  AttemptRunner(const std::vector<StagedPhoto>& photos, const PoseOptions& options,
                const std::string& work_folder, const ProgressFunction& progress,
                PoseReport* report);
  ~AttemptRunner();

  // A whole attempt, which may reuse the features and matches of the previous one. `number`
  // names its folder.
  AttemptResult Run(const PoseStrategy& strategy, size_t number);
  // Maps with the attempt's lens from its features and matches. Without models where COLMAP
  // fails.
  AttemptResult MapAgain(const AttemptResult& attempt);
  // Adjusts the attempt's best model.
  RefinedModel Refine(const AttemptResult& attempt);

  bool TimeIsOver() const;
  const std::vector<CameraGroup>& groups() const;
  const ColmapEvidence& evidence() const;  // of the last attempt

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace regrade
