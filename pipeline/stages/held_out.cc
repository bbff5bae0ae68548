#include "pipeline/stages/held_out.h"

#include <numeric>

#include "evaluate/image_quality.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_renderer.h"

namespace regrade {
namespace {

std::optional<double> Mean(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

}  // namespace

std::optional<double> HeldOutMetrics::MeanPsnr() const { return Mean(psnr); }
std::optional<double> HeldOutMetrics::MeanSsim() const { return Mean(ssim); }

HeldOutMetrics MeasureHeldOut(const Capture& capture, int holdout, int photo_size,
                              const PhotoGains& gains, const StoredField& stored,
                              Backend backend) {
  const FieldRenderer renderer(stored.field, backend);
  HeldOutMetrics metrics;
  for (const int i : ViewIndices(capture, holdout, true)) {
    const CaptureView& view = capture.views[static_cast<size_t>(i)];
    const Image photo = ReadPhotoToFit(view, photo_size, kAsTaken);
    if (photo.empty()) continue;
    const Camera camera =
        WorkingCamera(view.camera, photo_size, stored.field_from_world, stored.ndc);
    Image rendered = renderer.Render(camera).color;
    PutGain(gains.Of(i), &rendered);
    if (const auto value = Psnr(rendered, photo)) metrics.psnr.push_back(*value);
    if (const auto value = Ssim(rendered, photo)) metrics.ssim.push_back(*value);
    metrics.files.push_back(view.file);
  }
  return metrics;
}

}  // namespace regrade
