#include "kernels/image/detail_kept.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"
#include "kernels/image/row_sum.h"

namespace regrade {
namespace {

constexpr int kWindow = 16;
constexpr int kRadius = 4;  // pixels; beyond it G is below 4e-4 of its peak
constexpr double kSigma = 1;

struct Luma {
  double render = 0, photo = 0, weight = 0;  // weight 0: left out
};

double LumaOf(const Image& image, int x, int y) {
  const float* c = image.at(x, y);
  return image.channels < 3 ? c[0] : 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
}

std::array<double, 2 * kRadius + 1> Taps() {
  std::array<double, 2 * kRadius + 1> taps;
  for (int k = -kRadius; k <= kRadius; ++k)
    taps[k + kRadius] = std::exp(-k * k / (2 * kSigma * kSigma));
  return taps;
}

// Sum of G times the weighted values along one axis, `count` values `stride` apart.
Luma Blurred(const Luma* line, int at, int count, int stride) {
  static const auto taps = Taps();
  Luma sum;
  for (int k = std::max(at - kRadius, 0); k <= std::min(at + kRadius, count - 1); ++k) {
    const double tap = taps[k - at + kRadius];
    const Luma& value = line[static_cast<size_t>(k) * stride];
    sum.render += tap * value.render;
    sum.photo += tap * value.photo;
    sum.weight += tap * value.weight;
  }
  return sum;
}

struct Products {
  double rr = 0, rp = 0, pp = 0, dd = 0;  // d = r - p
  double kept = 0;
  int64_t count = 0;
  Products& operator+=(const Products& o) {
    rr += o.rr, rp += o.rp, pp += o.pp, dd += o.dd, kept += o.kept, count += o.count;
    return *this;
  }
};

}  // namespace

FineDetail MeasureFineDetail(const Image& render, const Image& photo) {
  REGRADE_CHECK(render.SameSize(photo));
  const int width = photo.width, height = photo.height;
  std::vector<Luma> luma(static_cast<size_t>(photo.num_pixels()));
  std::vector<Luma> rows(luma.size());  // blurred along x
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y) {
    Luma* const line = &luma[static_cast<size_t>(y) * width];
    for (int x = 0; x < width; ++x) {
      const double r = LumaOf(render, x, y), p = LumaOf(photo, x, y);
      if (std::isfinite(r) && std::isfinite(p)) line[x] = {r, p, 1};
    }
    for (int x = 0; x < width; ++x)
      rows[static_cast<size_t>(y) * width + x] = Blurred(line, x, width, 1);
  }
  const int across = (width + kWindow - 1) / kWindow, down = (height + kWindow - 1) / kWindow;
  const Products all = SumOverRows(down, [&](int window_row) {
    std::vector<Products> windows(across);
    for (int y = window_row * kWindow; y < std::min((window_row + 1) * kWindow, height); ++y)
      for (int x = 0; x < width; ++x) {
        const Luma& value = luma[static_cast<size_t>(y) * width + x];
        if (value.weight == 0) continue;
        const Luma mean = Blurred(&rows[x], y, height, width);
        const double r = value.render - mean.render / mean.weight;
        const double p = value.photo - mean.photo / mean.weight;
        windows[x / kWindow] += {r * r, r * p, p * p, (r - p) * (r - p), 0, 1};
      }
    Products sum;
    for (Products& w : windows) {
      if (w.rp > 0) w.kept = w.rp * std::min(1.0, w.rp / w.rr);
      sum += w;
    }
    return sum;
  });
  FineDetail detail;
  if (all.count == 0) return detail;
  const double count = static_cast<double>(all.count);
  detail.levels = 255 * std::sqrt(all.dd / count);
  if (all.pp > count * kRoundingVariance) detail.kept = std::clamp(all.kept / all.pp, 0.0, 1.0);
  return detail;
}

}  // namespace regrade
