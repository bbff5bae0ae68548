// Metrics of pictures against their ground truth, as benchmarks of 2D photorealistic style
// transfer have them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// EQ(histogram-correlation): mean over the colour channels of Pearson's correlation, over 256
// bins, of both pictures' histograms; a value v in [0, 1] is in bin round(255 v). In [-1, 1].
// Values that are not finite are in no bin. Empty where a histogram is flat or empty. Pictures
// may differ in size, not in channels.
std::optional<double> HistogramCorrelation(const Image& a, const Image& b);

struct PairedQuality {
  std::string name;               // of the picture
  std::optional<double> psnr_db;  // +inf for identical pictures
  std::optional<double> ssim;     // see EQ(ssim)
  std::optional<double> lpips;    // where a network was given
  std::optional<double> histogram_correlation;
};

// Of one picture and its ground truth, of one size. `perceptual` may be empty.
PairedQuality MeasurePair(const std::string& name, const Image& picture, const Image& truth,
                          const std::function<double(const Image&, const Image&)>& perceptual);

// One row of the table: a method's pictures.
struct PairedRow {
  std::string name;
  std::vector<PairedQuality> pictures;

  // The mean of those that have the metric, infinite ones left out.
  std::optional<double> Mean(std::optional<double> PairedQuality::*metric) const;
};

std::string FormatPairedTable(const std::vector<PairedRow>& rows, const std::string& form);

}  // namespace regrade
