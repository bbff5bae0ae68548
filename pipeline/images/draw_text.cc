#include "pipeline/images/draw_text.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kScale = 0.5, kSmallest = 0.5;  // below, text is illegible

}  // namespace

int TextLineHeight(double size) { return static_cast<int>(std::ceil(22 * size)); }

void DrawText(Image* picture, int x, int y, int width, const std::string& text, double size,
              float brightness) {
  REGRADE_CHECK(picture->channels == 3);
  std::string line;
  for (const char c : text) line += c >= 32 && c < 127 ? c : '?';
  const int height = TextLineHeight(size);
  const int long_side = cv::getTextSize(line, kFont, kScale * size, 1, nullptr).width;
  const double fitting =
      long_side > width ? std::max(kSmallest, static_cast<double>(width) / long_side) : 1;
  cv::Mat mask = cv::Mat::zeros(height, std::max(1, width), CV_8UC1);
  cv::putText(mask, line, {0, static_cast<int>(16 * size)}, kFont, kScale * size * fitting, 255,
              1, cv::LINE_AA);
  for (int v = 0; v < height && y + v < picture->height; ++v)
    for (int u = 0; u < mask.cols && x + u < picture->width; ++u) {
      if (x + u < 0 || y + v < 0) continue;
      const float share = static_cast<float>(mask.at<uint8_t>(v, u)) / 255;
      float* p = picture->at(x + u, y + v);
      for (int c = 0; c < 3; ++c) p[c] += share * (brightness - p[c]);
    }
}

}  // namespace regrade
