#include "kernels/image/detail_kept.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"
#include "kernels/image/row_sum.h"

namespace regrade {
namespace {

constexpr int kWindow = 16;
constexpr double kFine = 0.7, kCoarse = 1.4;  // pixels

struct Luma {
  double render = 0, photo = 0, weight = 0;  // weight 0: left out
};

double LumaOf(const Image& image, int x, int y) {
  const float* c = image.at(x, y);
  return image.channels < 3 ? c[0] : 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
}

// Taps of G at the distances 0, 1, ...; beyond 4 sigma they are below 4e-4 of the first.
std::vector<double> TapsOf(double sigma) {
  std::vector<double> taps;
  for (int k = 0; k <= std::ceil(4 * sigma); ++k)
    taps.push_back(std::exp(-k * k / (2 * sigma * sigma)));
  return taps;
}

// Sum of taps times the values of a line, `count` of them `stride` apart.
Luma Blurred(const std::vector<double>& taps, const Luma* line, int at, int count, int stride) {
  const int radius = static_cast<int>(taps.size()) - 1;
  Luma sum;
  for (int k = std::max(at - radius, 0); k <= std::min(at + radius, count - 1); ++k) {
    const double tap = taps[std::abs(k - at)];
    const Luma& value = line[static_cast<size_t>(k) * stride];
    sum.render += tap * value.render;
    sum.photo += tap * value.photo;
    sum.weight += tap * value.weight;
  }
  return sum;
}

// Sums of products of r_1, r_2 and p over a window, and of the squared error.
struct Products {
  double r11 = 0, r12 = 0, r22 = 0, r1p = 0, r2p = 0, pp = 0, squares = 0, count = 0;
  void Add(double r1, double r2, double p) {
    r11 += r1 * r1, r12 += r1 * r2, r22 += r2 * r2, r1p += r1 * p, r2p += r2 * p, pp += p * p;
    squares += (r1 + r2 - p) * (r1 + r2 - p);
    ++count;
  }
};

// E_w: the maximum is inside, or on the axis of one part.
double Explained(const Products& w) {
  const double a = w.r11 + w.count * kRoundingVariance, d = w.r22 + w.count * kRoundingVariance;
  const double det = a * d - w.r12 * w.r12;  // positive: the least eigenvalue is at least n v
  const double x1 = (d * w.r1p - w.r12 * w.r2p) / det, x2 = (a * w.r2p - w.r12 * w.r1p) / det;
  if (x1 >= 0 && x2 >= 0) return x1 * w.r1p + x2 * w.r2p;
  const double first = std::max(w.r1p, 0.0), second = std::max(w.r2p, 0.0);
  return std::max(first * first / a, second * second / d);
}

struct Sums {
  double explained = 0, energy = 0, squares = 0, count = 0;
  Sums& operator+=(const Sums& o) {
    explained += o.explained, energy += o.energy, squares += o.squares, count += o.count;
    return *this;
  }
};

}  // namespace

FineDetail MeasureFineDetail(const Image& render, const Image& photo) {
  REGRADE_CHECK(render.SameSize(photo));
  const int width = photo.width, height = photo.height;
  const std::vector<double> fine_taps = TapsOf(kFine), coarse_taps = TapsOf(kCoarse);
  std::vector<Luma> luma(static_cast<size_t>(photo.num_pixels()));
  std::vector<Luma> fine(luma.size()), coarse(luma.size());  // blurred along x
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (int x = 0; x < width; ++x) {
      const double r = LumaOf(render, x, y), p = LumaOf(photo, x, y);
      if (std::isfinite(r) && std::isfinite(p)) luma[begin + x] = {r, p, 1};
    }
    for (int x = 0; x < width; ++x) {
      fine[begin + x] = Blurred(fine_taps, &luma[begin], x, width, 1);
      coarse[begin + x] = Blurred(coarse_taps, &luma[begin], x, width, 1);
    }
  }
  const int across = (width + kWindow - 1) / kWindow, down = (height + kWindow - 1) / kWindow;
  const Sums all = SumOverRows(down, [&](int window_row) {
    std::vector<Products> windows(across);
    for (int y = window_row * kWindow; y < std::min((window_row + 1) * kWindow, height); ++y)
      for (int x = 0; x < width; ++x) {
        const Luma& value = luma[static_cast<size_t>(y) * width + x];
        if (value.weight == 0) continue;
        const Luma f = Blurred(fine_taps, &fine[x], y, height, width);
        const Luma c = Blurred(coarse_taps, &coarse[x], y, height, width);
        const double middle = f.render / f.weight;
        windows[x / kWindow].Add(value.render - middle, middle - c.render / c.weight,
                                 value.photo - c.photo / c.weight);
      }
    Sums sum;
    for (const Products& w : windows) {
      const bool flat = w.pp <= w.count * kRoundingVariance;
      sum += {flat ? 0 : Explained(w), flat ? 0 : w.pp, w.squares, w.count};
    }
    return sum;
  });
  FineDetail detail;
  if (all.count > 0) detail.levels = 255 * std::sqrt(all.squares / all.count);
  if (all.energy > 0) detail.kept = std::min(all.explained / all.energy, 1.0);
  return detail;
}

}  // namespace regrade
