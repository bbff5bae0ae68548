#include "evaluate/occlusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/row_sum.h"
#include "kernels/image/warp.h"

namespace regrade {
namespace {

struct Vec2 {
  double x = 0, y = 0;
  Vec2 operator+(const Vec2& o) const { return {x + o.x, y + o.y}; }
  Vec2 operator-(const Vec2& o) const { return {x - o.x, y - o.y}; }
  double Squared() const { return x * x + y * y; }
  bool Finite() const { return std::isfinite(x) && std::isfinite(y); }
};

Vec2 At(const FlowField& flow, int x, int y) { return {flow.at(x, y)[0], flow.at(x, y)[1]}; }

Vec2 SampleFlow(const FlowField& flow, const BilinearTaps& taps) {
  return {Sample(taps, flow.uv.data(), flow.width, 2, 0),
          Sample(taps, flow.uv.data(), flow.width, 2, 1)};
}

struct Counts {
  int64_t not_finite = 0, out_of_frame = 0, disoccluded = 0, motion_boundary = 0;
  Counts& operator+=(const Counts& o) {
    not_finite += o.not_finite;
    out_of_frame += o.out_of_frame;
    disoccluded += o.disoccluded;
    motion_boundary += o.motion_boundary;
    return *this;
  }
};

OcclusionMask MakeMask(Image weight, const Counts& counts) {
  return {std::move(weight), counts.not_finite, counts.out_of_frame, counts.disoccluded,
          counts.motion_boundary};
}

double RoundTripBound(const Vec2& f, const Vec2& w) {
  return 0.01 * (f.Squared() + w.Squared()) + 0.5;
}

double BoundaryBound(const Vec2& f) { return 0.01 * f.Squared() + 0.002; }

double ForwardDifferenceEnergy(const FlowField& flow, int x, int y) {
  const Vec2 f = At(flow, x, y);
  double energy = 0;
  if (x + 1 < flow.width) energy += (At(flow, x + 1, y) - f).Squared();
  if (y + 1 < flow.height) energy += (At(flow, x, y + 1) - f).Squared();
  return energy;
}

int Mirror(int i, int size) {
  if (i < 0) i = -1 - i;
  if (i >= size) i = 2 * size - 1 - i;
  return std::clamp(i, 0, size - 1);  // for images narrower than the filter
}

double CentralDifferenceEnergy(const FlowField& flow, int x, int y) {
  const auto at = [&](int i, int j) {
    return At(flow, Mirror(i, flow.width), Mirror(j, flow.height));
  };
  return 0.25 *
         ((at(x + 1, y) - at(x - 1, y)).Squared() + (at(x, y + 1) - at(x, y - 1)).Squared());
}

constexpr int kSmoothRadius = 2;
constexpr double kSmoothSigma = 0.8;

std::array<double, 2 * kSmoothRadius + 1> SmoothTaps() {
  std::array<double, 2 * kSmoothRadius + 1> taps;
  double sum = 0;
  for (int k = -kSmoothRadius; k <= kSmoothRadius; ++k)
    sum += taps[k + kSmoothRadius] = std::exp(-k * k / (2 * kSmoothSigma * kSmoothSigma));
  for (double& tap : taps) tap /= sum;
  return taps;
}

// Smooths values of -255, 0 and 255 and turns them into weights.
Image SmoothedWeights(const std::vector<double>& values, int width, int height) {
  const auto taps = SmoothTaps();
  std::vector<double> rows(values.size());
  Image weight(width, height, 1);
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (int k = -kSmoothRadius; k <= kSmoothRadius; ++k)
          sum += taps[k + kSmoothRadius] *
                 values[static_cast<size_t>(y) * width + Mirror(x + k, width)];
        rows[static_cast<size_t>(y) * width + x] = sum;
      }
#pragma omp for schedule(static)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (int k = -kSmoothRadius; k <= kSmoothRadius; ++k)
          sum += taps[k + kSmoothRadius] *
                 rows[static_cast<size_t>(Mirror(y + k, height)) * width + x];
        *weight.at(x, y) = static_cast<float>(std::clamp(sum, 0.0, 255.0) / 255.0);
      }
  }
  return weight;
}

}  // namespace

double OcclusionMask::Coverage() const {
  if (weight.empty()) return 0;
  const double sum = SumOverRows(weight.height, [&](int y) {
    double row = 0;
    for (int x = 0; x < weight.width; ++x) row += *weight.at(x, y);
    return row;
  });
  return sum / static_cast<double>(weight.num_pixels());
}

OcclusionMask MaskLai2018(const FlowField& forward, const FlowField& backward) {
  REGRADE_CHECK(forward.SameSize(backward));
  Image weight(forward.width, forward.height, 1);
  const Counts counts = SumOverRows(forward.height, [&](int y) {
    Counts row;
    for (int x = 0; x < forward.width; ++x) {
      const Vec2 f = At(forward, x, y);
      const BilinearTaps taps = TapsAt(x + f.x, y + f.y, forward.width, forward.height);
      const Vec2 w = SampleFlow(backward, taps);
      if (!f.Finite() || !w.Finite()) {
        ++row.not_finite;
        continue;
      }
      if (!taps.in_frame) ++row.out_of_frame;
      if ((w + f).Squared() > RoundTripBound(f, w)) {
        ++row.disoccluded;
      } else if (ForwardDifferenceEnergy(forward, x, y) > BoundaryBound(f)) {
        ++row.motion_boundary;
      } else {
        *weight.at(x, y) = 1;
      }
    }
    return row;
  });
  return MakeMask(std::move(weight), counts);
}

OcclusionMask MaskRuder2016(const FlowField& forward, const FlowField& backward) {
  REGRADE_CHECK(forward.SameSize(backward));
  const int width = forward.width, height = forward.height;
  std::vector<double> values(static_cast<size_t>(width) * height, 0.0);
  std::vector<char> usable(values.size(), 0);
  const Counts counts = SumOverRows(height, [&](int y) {
    Counts row;
    for (int x = 0; x < width; ++x) {
      const size_t i = static_cast<size_t>(y) * width + x;
      const Vec2 f = At(forward, x, y);
      if (!f.Finite()) {
        ++row.not_finite;
        continue;
      }
      const BilinearTaps taps = TapsAt(x + f.x, y + f.y, width, height);
      if (!taps.four_taps) {
        ++row.out_of_frame;
        continue;
      }
      const Vec2 w = SampleFlow(backward, taps);
      if (!w.Finite()) {
        ++row.not_finite;
        continue;
      }
      usable[i] = 1;
      if ((w + f).Squared() >= RoundTripBound(f, w)) {
        ++row.disoccluded;
        values[i] = -255;
      } else if (CentralDifferenceEnergy(forward, x, y) > BoundaryBound(f)) {
        ++row.motion_boundary;
      } else {
        values[i] = 255;
      }
    }
    return row;
  });
  Image weight = SmoothedWeights(values, width, height);
  for (size_t i = 0; i < usable.size(); ++i)
    if (!usable[i]) weight.pixels[i] = 0;
  return MakeMask(std::move(weight), counts);
}

}  // namespace regrade
