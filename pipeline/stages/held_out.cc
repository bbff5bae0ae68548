#include "pipeline/stages/held_out.h"

#include <numeric>

#include "evaluate/image_quality.h"
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

HeldOutMetrics MeasureHeldOut(const WorkingViews& views, const StoredField& stored,
                              Backend backend) {
  const WorkingViews as_taken = views.AsTaken().InField(stored.field_from_world, stored.ndc);
  const FieldRenderer renderer(stored.field, backend);
  HeldOutMetrics metrics;
  for (const int i : views.HeldOut()) {
    const Image photo = as_taken.PhotoToFit(i);
    if (photo.empty()) continue;
    Image rendered = renderer.Render(as_taken.CameraOf(i)).color;
    PutGain(views.Gain(i), &rendered);
    if (const auto value = Psnr(rendered, photo)) metrics.psnr.push_back(*value);
    if (const auto value = Ssim(rendered, photo)) metrics.ssim.push_back(*value);
    metrics.files.push_back(views.View(i).file);
  }
  return metrics;
}

}  // namespace regrade
