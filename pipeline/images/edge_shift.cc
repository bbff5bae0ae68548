#include "pipeline/images/edge_shift.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Magnitudes of the gradient of the mean of the channels.
cv::Mat Edges(const Image& image) {
  const auto grey = [&](int x, int y) {
    const float* p = image.at(x, y);
    double sum = 0;
    for (int c = 0; c < std::min(image.channels, 3); ++c) sum += std::isfinite(p[c]) ? p[c] : 0;
    return sum;
  };
  cv::Mat edges(image.height, image.width, CV_64F, cv::Scalar(0));
  for (int y = 1; y + 1 < image.height; ++y)
    for (int x = 1; x + 1 < image.width; ++x)
      edges.at<double>(y, x) =
          std::hypot(grey(x + 1, y) - grey(x - 1, y), grey(x, y + 1) - grey(x, y - 1));
  return edges;
}

// Standard deviation of the edges in a part: below it there is nothing to compare.
double Texture(const cv::Mat& part) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(part, mean, deviation);
  return deviation[0];
}

}  // namespace

EdgeShift MeasureEdgeShift(const Image& a, const Image& b) {
  REGRADE_CHECK(a.SameSize(b));
  constexpr double kLeastTexture = 0.02, kLeastPeak = 0.2;
  const cv::Mat edges_a = Edges(a), edges_b = Edges(b);
  const int side = std::min({std::max(48, std::max(a.width, a.height) / 8), a.width, a.height});
  cv::Mat window;
  cv::createHanningWindow(window, cv::Size(side, side), CV_64F);
  EdgeShift result;
  std::vector<double> peaks;
  for (int y = 0; y + side <= a.height; y += side / 2) {
    for (int x = 0; x + side <= a.width; x += side / 2) {
      const cv::Rect place(x, y, side, side);
      const cv::Mat part_a = edges_a(place).clone(), part_b = edges_b(place).clone();
      if (std::min(Texture(part_a), Texture(part_b)) < kLeastTexture) continue;
      double peak = 0;
      const cv::Point2d shift = cv::phaseCorrelate(part_a, part_b, window, &peak);
      peaks.push_back(peak);
      const double pixels = std::hypot(shift.x, shift.y);
      if (peak < kLeastPeak || pixels <= result.pixels) continue;
      result.pixels = pixels;
      result.x = x + side / 2.0;
      result.y = y + side / 2.0;
    }
  }
  result.parts = static_cast<int>(peaks.size());
  if (peaks.empty()) return result;
  std::ranges::nth_element(peaks, peaks.begin() + std::ssize(peaks) / 2);
  result.agreement = peaks[peaks.size() / 2];
  return result;
}

}  // namespace regrade
