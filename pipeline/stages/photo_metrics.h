// Measures a field on photos: its renders are compared with them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

// A value for each photo for which it is defined.
struct PhotoMetrics {
  std::vector<std::string> files;                 // the photos compared, the user's names
  std::vector<double> psnr, ssim;                 // dB; see Ssim
  std::vector<double> detail_kept, detail_error;  // see FineDetail
  std::vector<double> lpips;                      // where there is a `perceptual`
};

std::optional<double> MeanOf(const std::vector<double>& values);

// Compares renders with these photos of the field's capture, at the working size. A render gets
// its photo's gain, which is estimated from the colours of points shared with other photos.
// Masked pixels do not count; `perceptual` (see PerceptualDistance; may be empty) sees the
// render's own there.
PhotoMetrics MeasureOnPhotos(
    const WorkingViews& views, const std::vector<int>& of, const StoredField& stored,
    Backend backend, const std::function<double(const Image&, const Image&)>& perceptual = {});

// Eight training views, evenly spaced, or all if they are fewer: enough for a mean, and few to
// render.
std::vector<int> MeasuredTrainingViews(const WorkingViews& views);

}  // namespace regrade
