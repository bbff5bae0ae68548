// How well a field shows photos that it has not seen.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

struct HeldOutMetrics {
  std::vector<std::string> files;  // the photos kept for measuring, the user's names
  std::vector<double> psnr, ssim;  // of those that have one
  std::optional<double> MeanPsnr() const;
  std::optional<double> MeanSsim() const;
};

// Over the held-out photos as they were taken: a render is given its photo's gain, which is
// known from the colours of points that the photo shares with others. What is masked does not
// count.
HeldOutMetrics MeasureHeldOut(const WorkingViews& views, const StoredField& stored,
                              Backend backend);

}  // namespace regrade
