// A field fitted to pictures that a 2D method made of the photos: the naive way to style a
// scene, which LipRF's figure 1 compares with.
#pragma once

#include <functional>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

struct FittedPictures {
  StoredField stored;  // colours as a file stores them
  double psnr_train_db = 0;
};

// With the options of `settings`, of the run that fitted `scene` to the photos: in its box,
// whose frame `views` are in, and with at most its degree of harmonics. `picture(i)` is that of
// view i, one of `indices`, of its camera's size; NaN is not fitted. Where the colour behind
// everything is fixed, it is `background`.
FittedPictures FitPictures(const WorkingViews& views, const StoredField& scene,
                           const std::vector<int>& indices,
                           const std::function<Image(int)>& picture,
                           const RunSettings& settings, const Vec3f& background,
                           Backend backend, const ProgressFunction& progress);

}  // namespace regrade
