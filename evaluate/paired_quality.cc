#include "evaluate/paired_quality.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evaluate/bootstrap.h"
#include "evaluate/image_quality.h"
#include "evaluate/table_text.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kBins = 256;
using Histogram = std::array<double, kBins>;

// Shares of the pixels; all 0 without any.
Histogram HistogramOf(const Image& image, int channel) {
  Histogram histogram{};
  double count = 0;
  for (int64_t p = 0; p < image.num_pixels(); ++p) {
    const float value = image.pixels[static_cast<size_t>(p * image.channels + channel)];
    if (!std::isfinite(value)) continue;
    ++histogram[static_cast<size_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)))];
    ++count;
  }
  if (count > 0)
    for (double& bin : histogram) bin /= count;
  return histogram;
}

std::optional<double> Correlation(const Histogram& a, const Histogram& b) {
  double mean_a = 0, mean_b = 0;
  for (int i = 0; i < kBins; ++i) mean_a += a[i] / kBins, mean_b += b[i] / kBins;
  double aa = 0, bb = 0, ab = 0;
  for (int i = 0; i < kBins; ++i) {
    const double da = a[i] - mean_a, db = b[i] - mean_b;
    aa += da * da, bb += db * db, ab += da * db;
  }
  const double scale = std::sqrt(aa) * std::sqrt(bb);
  if (!(scale > 0)) return std::nullopt;
  return std::clamp(ab / scale, -1.0, 1.0);
}

// "24.31 [23.10, 25.02]": the mean and its interval over pictures.
std::string WithInterval(const PairedRow& row, std::optional<double> PairedQuality::*metric,
                         int decimals) {
  const std::optional<double> mean = row.Mean(metric);
  if (!mean) return "-";
  std::vector<double> values;
  for (const PairedQuality& picture : row.pictures)
    if (picture.*metric && std::isfinite(*(picture.*metric)))
      values.push_back(*(picture.*metric));
  const auto interval = BootstrapMean(values, 1);
  std::string text = TableNumber(mean, decimals);
  if (interval) text += " " + IntervalText(interval->low, interval->high, decimals);
  return text;
}

}  // namespace

std::optional<double> HistogramCorrelation(const Image& a, const Image& b) {
  const int channels = std::min(a.channels, 3);
  REGRADE_CHECK(channels == std::min(b.channels, 3));
  double sum = 0;
  for (int c = 0; c < channels; ++c) {
    const auto correlation = Correlation(HistogramOf(a, c), HistogramOf(b, c));
    if (!correlation) return std::nullopt;
    sum += *correlation;
  }
  return sum / channels;
}

PairedQuality MeasurePair(const std::string& name, const Image& picture, const Image& truth,
                          const std::function<double(const Image&, const Image&)>& perceptual) {
  PairedQuality quality;
  quality.name = name;
  quality.psnr_db = Psnr(picture, truth);
  quality.ssim = Ssim(picture, truth);
  quality.histogram_correlation = HistogramCorrelation(picture, truth);
  if (perceptual) quality.lpips = perceptual(picture, truth);
  return quality;
}

std::optional<double> PairedRow::Mean(std::optional<double> PairedQuality::*metric) const {
  double sum = 0;
  int count = 0;
  for (const PairedQuality& picture : pictures)
    if (picture.*metric && std::isfinite(*(picture.*metric))) {
      sum += *(picture.*metric);
      ++count;
    }
  if (count == 0) return std::nullopt;
  return sum / count;
}

std::string FormatPairedTable(const std::vector<PairedRow>& rows, const std::string& form) {
  const bool lpips = std::ranges::any_of(
      rows, [](const PairedRow& row) { return row.Mean(&PairedQuality::lpips).has_value(); });
  std::vector<TableCells> cells{{"pictures of", "number", "PSNR", "SSIM", "H-Corr"}};
  if (lpips) cells[0].push_back("LPIPS");
  for (const PairedRow& row : rows) {
    cells.push_back({row.name, std::to_string(row.pictures.size()),
                     WithInterval(row, &PairedQuality::psnr_db, 2),
                     WithInterval(row, &PairedQuality::ssim, 3),
                     WithInterval(row, &PairedQuality::histogram_correlation, 3)});
    if (lpips) cells.back().push_back(WithInterval(row, &PairedQuality::lpips, 3));
  }
  return FormatTable(
      "Pictures against their ground truth: means with 95 % intervals (bootstrap over "
      "pictures)",
      cells, "", {form, "tab:pictures"});
}

}  // namespace regrade
