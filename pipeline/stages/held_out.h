// Measures a field on photos that were held out of the fit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

struct HeldOutMetrics {
  std::vector<std::string> files;  // the held-out photos, the user's names
  std::vector<double> psnr, ssim;  // of those where it is defined
  std::optional<double> MeanPsnr() const;
  std::optional<double> MeanSsim() const;
};

// Compares renders with the held-out photos. A render gets its photo's gain, which is estimated
// from the colours of points shared with other photos. Masked pixels do not count.
HeldOutMetrics MeasureHeldOut(const WorkingViews& views, const StoredField& stored,
                              Backend backend);

}  // namespace regrade
