#include "pipeline/stages/fit_quality.h"

#include <cstdio>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/detail_kept.h"
#include "pipeline/files/text.h"
#include "pipeline/stages/photo_metrics.h"

namespace regrade {
namespace {

void SetPhotoMetrics(const PhotoMetrics& held_out, const PhotoMetrics& train,
                     ReconstructReport* metrics) {
  const auto metric = [](const PhotoMetrics& of, std::vector<double> PhotoMetrics::*values,
                         const char* why = "") {
    return Metric(MeanOf(of.*values), of.files.empty() ? "no photo was held out" : why);
  };
  const char* flat = "the photos have no fine detail";
  metrics->heldout = held_out.files;
  metrics->psnr_heldout_db = metric(held_out, &PhotoMetrics::psnr);
  metrics->ssim_heldout = metric(held_out, &PhotoMetrics::ssim);
  metrics->detail_kept_heldout = metric(held_out, &PhotoMetrics::detail_kept, flat);
  metrics->detail_error_heldout = metric(held_out, &PhotoMetrics::detail_error);
  metrics->ssim_train = metric(train, &PhotoMetrics::ssim);
  metrics->detail_kept_train = metric(train, &PhotoMetrics::detail_kept, flat);
  metrics->detail_error_train = metric(train, &PhotoMetrics::detail_error);
  const auto& kept = metrics->detail_kept_heldout.value ? metrics->detail_kept_heldout.value
                                                        : metrics->detail_kept_train.value;
  if (kept) metrics->sharpness = SharpnessWord(*kept);
}

// "reconstruction: slightly soft, detail kept 0.62; 27.51 dB, SSIM 0.812 on held-out photos"
std::string QualityLine(const ReconstructReport& metrics) {
  const auto number = [](const Metric& metric, const char* format) {
    char text[32] = "-";
    if (metric.value) std::snprintf(text, sizeof text, format, *metric.value);
    return std::string(text);
  };
  const bool held_out = !metrics.heldout.empty();
  return "reconstruction: " + (metrics.sharpness.empty() ? "" : metrics.sharpness + ", ") +
         "detail kept " +
         number(held_out ? metrics.detail_kept_heldout : metrics.detail_kept_train, "%.2f") +
         "; " + number(held_out ? metrics.psnr_heldout_db : metrics.psnr_train_db, "%.2f") +
         " dB, SSIM " + number(held_out ? metrics.ssim_heldout : metrics.ssim_train, "%.3f") +
         (held_out ? " on held-out photos" : " on training photos");
}

}  // namespace

void MeasureFit(const WorkingViews& views, const StoredField& stored, Backend backend,
                bool given, Console* console, ReconstructReport* metrics) {
  if (views.capture().rendered) {
    const Metric none = Metric::Undefined("there are no photos");
    for (Metric* metric :
         {&metrics->ssim_train, &metrics->detail_kept_train, &metrics->detail_error_train,
          &metrics->psnr_heldout_db, &metrics->ssim_heldout, &metrics->detail_kept_heldout,
          &metrics->detail_error_heldout})
      *metric = none;
    return;
  }
  SetPhotoMetrics(MeasureOnPhotos(views, views.HeldOut(), stored, backend),
                  MeasureOnPhotos(views, MeasuredTrainingViews(views), stored, backend),
                  metrics);
  if (const Metric& kept =
          metrics->heldout.empty() ? metrics->detail_kept_train : metrics->detail_kept_heldout;
      kept.value)
    console->Info(Format("the scene shows %.0f %% of the fine detail of %s: %s",
                         100 * *kept.value,
                         metrics->heldout.empty() ? "the photos"
                         : given ? "some photos, to which it may have been fitted"
                                 : "photos that were kept out of the fit",
                         metrics->sharpness.c_str()));
  console->Detail(QualityLine(*metrics));
}

}  // namespace regrade
