#include "evaluate/warped_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr double kWhite = 255;
constexpr double kSteepness = 10;  // of the importance, and its bound
constexpr double kPublishedBias = 1e-7;
constexpr int kMultiple = 8;

int Colours(const Image& image) { return image.channels >= 3 ? 3 : 1; }

// The four pixels around a position: those inside the image, with their bilinear weights.
struct InnerTaps {
  int count = 0;
  int64_t pixel[4] = {};
  double weight[4] = {};
};

InnerTaps TapsInside(double x, double y, int width, int height) {
  InnerTaps taps;
  // False for NaN, too; and the conversions below stay within int.
  if (!(x > -1 && x < width && y > -1 && y < height)) return taps;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const double ax = x - left, ay = y - top;
  for (int dy = 0; dy < 2; ++dy)
    for (int dx = 0; dx < 2; ++dx) {
      const int tx = left + dx, ty = top + dy;
      const double weight = (dx ? ax : 1 - ax) * (dy ? ay : 1 - ay);
      if (tx < 0 || ty < 0 || tx >= width || ty >= height || weight == 0) continue;
      taps.pixel[taps.count] = static_cast<int64_t>(ty) * width + tx;
      taps.weight[taps.count++] = weight;
    }
  return taps;
}

double Importance(const Image& first, int64_t pixel, const Image& second,
                  const InnerTaps& taps) {
  const int channels = std::min(Colours(first), Colours(second));
  double sum = 0;
  for (int c = 0; c < channels; ++c) {
    double sampled = 0;
    for (int k = 0; k < taps.count; ++k)
      sampled += taps.weight[k] * second.pixels[taps.pixel[k] * second.channels + c];
    sum += std::abs(first.pixels[pixel * first.channels + c] - sampled);
  }
  return std::max(-kSteepness, -kSteepness * kWhite * sum / channels);
}

bool IsFinite(const Image& image, int64_t pixel) {
  for (int c = 0; c < Colours(image); ++c)
    if (!std::isfinite(image.pixels[pixel * image.channels + c])) return false;
  return true;
}

// Pads one side on each axis to the next multiple of eight; `at` is the pixel that it repeats.
struct Padding {
  int before = 0, size = 0, side = 0;
  explicit Padding(int side) : side(side) {
    const int added = (kMultiple - side % kMultiple) % kMultiple;
    before = added / 2;
    size = side + added;
  }
  int at(int padded) const { return std::clamp(padded - before, 0, side - 1); }
};

}  // namespace

MovedFrame SoftmaxSplat(const Image& moved, const Image& first, const Image& second,
                        const FlowField& flow, double scale_x, double scale_y, double bias) {
  const int width = flow.width, height = flow.height, channels = Colours(moved);
  for (const Image* image : {&moved, &first, &second}) {
    REGRADE_CHECK_EQ(image->width, width);
    REGRADE_CHECK_EQ(image->height, height);
  }
  std::vector<double> sum(static_cast<size_t>(moved.num_pixels()) * channels);
  std::vector<double> norm(static_cast<size_t>(moved.num_pixels()));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int64_t pixel = static_cast<int64_t>(y) * width + x;
      const double u = flow.at(x, y)[0], v = flow.at(x, y)[1];
      if (!std::isfinite(u) || !std::isfinite(v) || !IsFinite(moved, pixel)) continue;
      const double importance = Importance(
          first, pixel, second, TapsInside(x + scale_x * u, y + scale_y * v, width, height));
      if (!std::isfinite(importance)) continue;
      const InnerTaps taps = TapsInside(x + u, y + v, width, height);
      for (int k = 0; k < taps.count; ++k) {
        const double weight = taps.weight[k] * std::exp(importance);
        norm[taps.pixel[k]] += weight;
        for (int c = 0; c < channels; ++c)
          sum[taps.pixel[k] * channels + c] +=
              weight * moved.pixels[pixel * moved.channels + c];
      }
    }
  MovedFrame result{Image(width, height, channels), Image(width, height, 1)};
  for (size_t p = 0; p < norm.size(); ++p) {
    result.weight.pixels[p] = static_cast<float>(norm[p]);
    if (!(norm[p] > 0)) continue;
    for (int c = 0; c < channels; ++c)
      result.color.pixels[p * channels + c] =
          static_cast<float>(sum[p * channels + c] / (norm[p] + bias));
  }
  return result;
}

WarpedError PublishedWarpedError(const Image& earlier, const Image& later,
                                 const FlowField& flow, const PairDistance& lpips) {
  const double width = earlier.width, height = earlier.height;
  MovedFrame warped = SoftmaxSplat(earlier, earlier, later, flow, width / (width - 1),
                                   height / (height - 1), kPublishedBias);
  const int channels = warped.color.channels;
  Image masked(earlier.width, earlier.height, channels);
  double squares = 0;
  int64_t inside = 0;
  for (int64_t p = 0; p < earlier.num_pixels(); ++p) {
    double sum = 0;
    for (int c = 0; c < channels; ++c) sum += warped.color.pixels[p * channels + c];
    if (sum == 0 || !IsFinite(later, p)) {
      for (int c = 0; c < channels; ++c) warped.color.pixels[p * channels + c] = 0;
      continue;
    }
    ++inside;
    for (int c = 0; c < channels; ++c) {
      const float value = later.pixels[p * later.channels + c];
      masked.pixels[p * channels + c] = value;
      const double d = static_cast<double>(warped.color.pixels[p * channels + c]) - value;
      squares += d * d;
    }
  }
  WarpedError error;
  const double values = static_cast<double>(earlier.num_pixels()) * channels;
  error.coverage = static_cast<double>(inside) / static_cast<double>(earlier.num_pixels());
  error.rmse = std::sqrt(squares / values);
  if (lpips) {
    for (Image* image : {&warped.color, &masked})
      for (float& value : image->pixels) value *= static_cast<float>(kWhite);
    error.lpips = lpips(warped.color, masked);
  }
  return error;
}

WarpedError CorrectedWarpedError(const Image& earlier, const Image& later,
                                 const Image& unstyled_earlier, const Image& unstyled_later,
                                 const FlowField& flow, const PairDistance& lpips) {
  MovedFrame warped = SoftmaxSplat(earlier, unstyled_earlier, unstyled_later, flow, 1, 1, 0);
  const int channels = warped.color.channels;
  Image target(earlier.width, earlier.height, channels);
  double squares = 0;
  int64_t inside = 0;
  for (int64_t p = 0; p < earlier.num_pixels(); ++p) {
    const bool compared = warped.weight.pixels[p] > 0 && IsFinite(later, p);
    inside += compared;
    for (int c = 0; c < channels; ++c) {
      float* moved = &warped.color.pixels[p * channels + c];
      const float value = later.pixels[p * later.channels + c];
      target.pixels[p * channels + c] = std::isfinite(value) ? value : 0;
      if (!compared) *moved = target.pixels[p * channels + c];
      const double d = static_cast<double>(*moved) - target.pixels[p * channels + c];
      squares += d * d;
    }
  }
  WarpedError error;
  error.coverage = static_cast<double>(inside) / static_cast<double>(earlier.num_pixels());
  if (inside == 0) return error;
  error.rmse = std::sqrt(squares / (static_cast<double>(inside) * channels));
  if (lpips) error.lpips = lpips(warped.color, target) / error.coverage;
  return error;
}

Image PadFrame(const Image& frame) {
  const Padding columns(frame.width), rows(frame.height);
  const int channels = Colours(frame);
  Image padded(columns.size, rows.size, channels);
  for (int y = 0; y < rows.size; ++y)
    for (int x = 0; x < columns.size; ++x)
      std::copy_n(frame.at(columns.at(x), rows.at(y)), channels, padded.at(x, y));
  return padded;
}

FlowField PadFlow(const FlowField& flow) {
  const Padding columns(flow.width), rows(flow.height);
  FlowField padded(columns.size, rows.size);
  for (int y = 0; y < rows.size; ++y)
    for (int x = 0; x < columns.size; ++x)
      std::copy_n(flow.at(columns.at(x), rows.at(y)), 2, padded.at(x, y));
  return padded;
}

}  // namespace regrade
