#include "pipeline/stages/photo_metrics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "evaluate/image_quality.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/image/detail_kept.h"
#include "kernels/render/field_renderer.h"

namespace regrade {
namespace {

constexpr int kMeasuredTrainingViews = 8;

void Append(const std::optional<double>& value, std::vector<double>* values) {
  if (value) values->push_back(*value);
}

}  // namespace

std::optional<double> MeanOf(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

PhotoMetrics MeasureOnPhotos(
    const WorkingViews& views, const std::vector<int>& of, const StoredField& stored,
    Backend backend, const std::function<double(const Image&, const Image&)>& perceptual) {
  const WorkingViews as_taken = views.AsTaken().InField(stored);
  const FieldRenderer renderer(stored.field, backend);
  PhotoMetrics metrics;
  const auto measure = [&](int64_t k, Image photo) {
    if (photo.empty()) return;
    const int i = of[static_cast<size_t>(k)];
    Image rendered = renderer.Render(as_taken.CameraOf(i)).color;
    PutGain(views.Gain(i), &rendered);
    Append(Psnr(rendered, photo), &metrics.psnr);
    Append(Ssim(rendered, photo), &metrics.ssim);
    const FineDetail detail = MeasureFineDetail(rendered, photo);
    Append(detail.kept, &metrics.detail_kept);
    Append(detail.levels, &metrics.detail_error);
    metrics.files.push_back(views.View(i).file);
    if (!perceptual) return;
    for (size_t v = 0; v < photo.pixels.size(); ++v)
      if (!std::isfinite(photo.pixels[v])) photo.pixels[v] = rendered.pixels[v];
    metrics.lpips.push_back(perceptual(rendered, photo));
  };
  MakeAhead(
      std::ssize(of), LargestPhotoBytes(as_taken.capture()),
      [&](int64_t k) { return as_taken.PhotoToFit(of[static_cast<size_t>(k)]); }, measure);
  return metrics;
}

std::vector<int> MeasuredTrainingViews(const WorkingViews& views) {
  const std::vector<int> all = views.Training();
  const size_t n = all.size(), k = std::min<size_t>(n, kMeasuredTrainingViews);
  std::vector<int> some;
  for (size_t i = 0; i < k; ++i) some.push_back(all[(2 * i + 1) * n / (2 * k)]);
  return some;
}

}  // namespace regrade
