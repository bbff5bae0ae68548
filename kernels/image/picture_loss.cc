#include "kernels/image/picture_loss.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kTaps = 2 * kSsimReach + 1;

// --- plain

template <typename T>
struct Plane {
  int width, height;
  std::vector<T> values;  // [H, W, 3]

  Plane(int width, int height)
      : width(width), height(height), values(3 * static_cast<size_t>(width) * height) {}
  T& operator[](size_t i) { return values[i]; }
  T operator[](size_t i) const { return values[i]; }

  Plane Blurred() const {
    const std::vector<T> taps = SsimTaps<T>();
    Plane across(width, height), both(width, height);
    const auto add = [&](const Plane& from, bool down, Plane* to) {
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          for (int k = -kSsimReach; k <= kSsimReach; ++k) {
            const int u = down ? x : x + k, v = down ? y + k : y;
            if (u < 0 || v < 0 || u >= width || v >= height) continue;
            for (int c = 0; c < 3; ++c)
              (*to)[3 * (static_cast<size_t>(y) * width + x) + c] +=
                  taps[static_cast<size_t>(k + kSsimReach)] *
                  from[3 * (static_cast<size_t>(v) * width + u) + c];
          }
    };
    add(*this, false, &across);
    add(across, true, &both);
    return both;
  }
};

template <typename T, typename Value>
Plane<T> Made(int width, int height, const Value& value) {
  Plane<T> plane(width, height);
  for (size_t i = 0; i < plane.values.size(); ++i) plane[i] = value(i);
  return plane;
}

// --- fast

constexpr int kMargin = 3 * kSsimReach;  // floats of 0 on both sides of a row
constexpr int kBand = 16;                // rows of a task

struct Taps {
  float of[kTaps];
  Taps() {
    const std::vector<double> taps = SsimTaps<double>();
    for (int k = 0; k < kTaps; ++k) of[k] = static_cast<float>(taps[static_cast<size_t>(k)]);
  }
};

// `in` points behind its left margin. out [n].
void BlurAcross(const Taps& taps, const float* in, int n, float* out) {
  for (int i = 0; i < n; ++i) {
    float sum = taps.of[kSsimReach] * in[i];
    for (int k = 1; k <= kSsimReach; ++k)
      sum += taps.of[kSsimReach + k] * (in[i - 3 * k] + in[i + 3 * k]);
    out[i] = sum;
  }
}

// rows [kTaps] of n floats each, `stride` apart.
void BlurDown(const Taps& taps, const float* rows, int64_t stride, int n, float* out) {
  const float* const middle = rows + kSsimReach * stride;
  for (int i = 0; i < n; ++i) {
    float sum = taps.of[kSsimReach] * middle[i];
    for (int k = 1; k <= kSsimReach; ++k)
      sum += taps.of[kSsimReach + k] * (middle[i - k * stride] + middle[i + k * stride]);
    out[i] = sum;
  }
}

// Of n values, in lanes that the compiler may vectorise.
float SumOf(const float* values, int n) {
  constexpr int kLanes = 16;
  float lanes[kLanes] = {}, sum = 0;
  int i = 0;
  for (; i + kLanes <= n; i += kLanes)
    for (int l = 0; l < kLanes; ++l) lanes[l] += values[i + l];
  for (; i < n; ++i) sum += values[i];
  for (int l = 0; l < kLanes; ++l) sum += lanes[l];
  return sum;
}

// A band's rows under the windows along x: kBand + 2 kSsimReach rows, 0 beyond the picture.
struct BandRows {
  std::vector<float> values;
  int n;

  explicit BandRows(int n)
      : values(static_cast<size_t>(kBand + 2 * kSsimReach) * static_cast<size_t>(n)), n(n) {}
  float* Row(int r) { return &values[static_cast<size_t>(r) * static_cast<size_t>(n)]; }
  void Down(const Taps& taps, int r, float* out) { BlurDown(taps, Row(r), n, n, out); }
};

// Calls row(y, r, inside) for the rows of a band and its margins, r counted from its first.
template <typename Row>
void ForRows(int y0, int height, const Row& row) {
  const int rows = std::min(kBand, height - y0) + 2 * kSsimReach;
  for (int r = 0; r < rows; ++r) {
    const int y = y0 - kSsimReach + r;
    row(y, r, y >= 0 && y < height);
  }
}

struct Comparison {
  int width, height, n;
  int64_t stride;
  float per_value, lambda;
  Taps taps;
  LossRows* rows;
  float* d;
  std::vector<PictureSums> of_row;

  float* At(std::vector<float>* plane, int y) const {
    return plane->data() + y * stride + kMargin;
  }

  // Fills photo and picture, and writes the gradient of the absolute difference.
  void Absolute(int y, const uint16_t* photo, const uint8_t* masked, const float* picture) {
    float* const to = At(&rows->photo, y);
    float* const seen = At(&rows->picture, y);
    const int64_t first = int64_t{y} * n;
    float* const slope = d + first;
    const float weight = (1 - lambda) * per_value;
    for (int i = 0; i < n; ++i) to[i] = static_cast<float>(photo[first + i]) * (1 / 65535.0f);
    std::copy_n(picture + first, n, seen);
    int64_t hidden = 0;
    if (masked != nullptr)
      for (int x = 0; x < width; ++x) {
        if (masked[int64_t{y} * width + x] == 0) continue;
        hidden += 3;
        for (int c = 0; c < 3; ++c) to[3 * x + c] = seen[3 * x + c] = 0;
      }
    std::vector<float> differences(2 * static_cast<size_t>(n));
    float *const absolute = differences.data(), *const squared = absolute + n;
    for (int i = 0; i < n; ++i) {
      const float difference = seen[i] - to[i];
      absolute[i] = std::abs(difference);
      squared[i] = difference * difference;
      slope[i] = difference > 0 ? weight : difference < 0 ? -weight : 0.0f;
    }
    of_row[static_cast<size_t>(y)] = {SumOf(absolute, n), SumOf(squared, n), 0, n - hidden};
  }

  void Slopes(int y0) {
    BandRows p(n), q(n), r_xy(n), m(n), square(n);
    std::vector<float> product(static_cast<size_t>(stride));
    ForRows(y0, height, [&](int y, int r, bool inside) {
      if (!inside) {
        for (BandRows* band : {&p, &q, &r_xy, &m, &square}) std::fill_n(band->Row(r), n, 0.0f);
        return;
      }
      const float* const x = At(&rows->picture, y);
      const float* const own = At(&rows->photo, y);
      const auto blur = [&](const float* a, const float* b, float* out) {
        for (int i = 0; i < n; ++i) product[static_cast<size_t>(kMargin + i)] = a[i] * b[i];
        BlurAcross(taps, product.data() + kMargin, n, out);
      };
      BlurAcross(taps, x, n, p.Row(r));
      BlurAcross(taps, own, n, m.Row(r));
      blur(x, x, q.Row(r));
      blur(x, own, r_xy.Row(r));
      blur(own, own, square.Row(r));
    });
    std::vector<float> down(6 * static_cast<size_t>(n));
    float* const of[5] = {down.data(), down.data() + n, down.data() + 2 * n,
                          down.data() + 3 * n, down.data() + 4 * n};
    float* const similarity = down.data() + 5 * n;
    for (int y = y0; y < std::min(y0 + kBand, height); ++y) {
      BandRows* const bands[5] = {&p, &q, &r_xy, &m, &square};
      for (int k = 0; k < 5; ++k) bands[k]->Down(taps, y - y0, of[k]);
      float* const by[3] = {At(&rows->by_p, y), At(&rows->by_q, y), At(&rows->by_r, y)};
      for (int i = 0; i < n; ++i) {
        const SsimSlopes<float> slopes =
            SsimOf(of[0][i], of[1][i], of[2][i], of[3][i], of[4][i]);
        similarity[i] = slopes.s;
        by[0][i] = slopes.by_p;
        by[1][i] = slopes.by_q;
        by[2][i] = slopes.by_r;
      }
      of_row[static_cast<size_t>(y)].similarity = SumOf(similarity, n);
    }
  }

  void Gradient(int y0) {
    BandRows p(n), q(n), r_xy(n);
    ForRows(y0, height, [&](int y, int r, bool inside) {
      const auto blur = [&](std::vector<float>* from, BandRows* to) {
        if (inside)
          BlurAcross(taps, At(from, y), n, to->Row(r));
        else
          std::fill_n(to->Row(r), n, 0.0f);
      };
      blur(&rows->by_p, &p);
      blur(&rows->by_q, &q);
      blur(&rows->by_r, &r_xy);
    });
    std::vector<float> down(3 * static_cast<size_t>(n));
    const float* const of[3] = {down.data(), down.data() + n, down.data() + 2 * n};
    for (int y = y0; y < std::min(y0 + kBand, height); ++y) {
      p.Down(taps, y - y0, down.data());
      q.Down(taps, y - y0, down.data() + n);
      r_xy.Down(taps, y - y0, down.data() + 2 * n);
      const float* const x = At(&rows->picture, y);
      const float* const own = At(&rows->photo, y);
      float* const slope = d + int64_t{y} * n;
      const float weight = lambda * per_value;
      for (int i = 0; i < n; ++i)
        slope[i] -= weight * (of[0][i] + 2 * x[i] * of[1][i] + own[i] * of[2][i]);
    }
  }
};

}  // namespace

template <typename T>
std::vector<T> SsimTaps() {
  std::vector<T> taps;
  double sum = 0;
  for (int k = -kSsimReach; k <= kSsimReach; ++k)
    sum += std::exp(-k * k / (2 * kSsimSigma * kSsimSigma));
  for (int k = -kSsimReach; k <= kSsimReach; ++k)
    taps.push_back(static_cast<T>(std::exp(-k * k / (2 * kSsimSigma * kSsimSigma)) / sum));
  return taps;
}

template <typename T>
PictureSums ComparePlain(int width, int height, const T* photo, const T* picture, T lambda,
                         T* d_picture) {
  const size_t n = 3 * static_cast<size_t>(width) * height;
  std::vector<bool> masked(n);
  for (size_t p = 0; p < n; p += 3)
    for (size_t c = 0; c < 3; ++c)
      if (!std::isfinite(photo[p + c])) masked[p] = masked[p + 1] = masked[p + 2] = true;
  const auto plane = [&](const auto& value) { return Made<T>(width, height, value); };
  const Plane<T> x = plane([&](size_t i) { return masked[i] ? T(0) : picture[i]; });
  const Plane<T> y = plane([&](size_t i) { return masked[i] ? T(0) : photo[i]; });
  const Plane<T> p = x.Blurred(), m = y.Blurred();
  const Plane<T> q = plane([&](size_t i) { return x[i] * x[i]; }).Blurred();
  const Plane<T> r = plane([&](size_t i) { return x[i] * y[i]; }).Blurred();
  const Plane<T> square = plane([&](size_t i) { return y[i] * y[i]; }).Blurred();
  PictureSums sums;
  Plane<T> by_p(width, height), by_q = by_p, by_r = by_p;
  for (size_t i = 0; i < n; ++i) {
    const SsimSlopes<T> slopes = SsimOf(p[i], q[i], r[i], m[i], square[i]);
    by_p[i] = slopes.by_p, by_q[i] = slopes.by_q, by_r[i] = slopes.by_r;
    sums.similarity += static_cast<double>(slopes.s);
  }
  const Plane<T> d_p = by_p.Blurred(), d_q = by_q.Blurred(), d_r = by_r.Blurred();
  const T per_value = T(1) / static_cast<T>(n);
  for (size_t i = 0; i < n; ++i) {
    d_picture[i] = 0;
    if (masked[i]) continue;
    const T difference = x[i] - y[i];
    sums.absolute += static_cast<double>(std::abs(difference));
    sums.squared += static_cast<double>(difference) * static_cast<double>(difference);
    ++sums.values;
    const T sign = difference > 0 ? T(1) : difference < 0 ? T(-1) : T(0);
    d_picture[i] = per_value * ((1 - lambda) * sign -
                                lambda * (d_p[i] + 2 * x[i] * d_q[i] + y[i] * d_r[i]));
  }
  return sums;
}

PictureSums Compare(int width, int height, const uint16_t* photo, const uint8_t* masked,
                    const float* picture, float lambda, LossRows* rows, float* d_picture) {
  const int n = 3 * width;
  Comparison work{width,
                  height,
                  n,
                  n + 2 * kMargin,
                  static_cast<float>(1.0 / (3.0 * width * height)),
                  lambda,
                  {},
                  rows,
                  d_picture,
                  std::vector<PictureSums>(static_cast<size_t>(height))};
  for (std::vector<float>* plane :
       {&rows->photo, &rows->picture, &rows->by_p, &rows->by_q, &rows->by_r})
    if (plane->size() != static_cast<size_t>(work.stride * height))
      plane->assign(static_cast<size_t>(work.stride * height), 0.0f);
  const int bands = (height + kBand - 1) / kBand;
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (int y = 0; y < height; ++y) work.Absolute(y, photo, masked, picture);
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < bands; ++band) work.Slopes(band * kBand);
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < bands; ++band) work.Gradient(band * kBand);
#pragma omp for schedule(static)
    for (int64_t p = 0; p < int64_t{width} * height; ++p)
      if (masked != nullptr && masked[p] != 0)
        d_picture[3 * p] = d_picture[3 * p + 1] = d_picture[3 * p + 2] = 0;
  }
  PictureSums sums;
  for (const PictureSums& row : work.of_row) {
    sums.absolute += row.absolute;
    sums.squared += row.squared;
    sums.similarity += row.similarity;
    sums.values += row.values;
  }
  return sums;
}

template std::vector<float> SsimTaps<float>();
template std::vector<double> SsimTaps<double>();
template PictureSums ComparePlain(int, int, const float*, const float*, float, float*);
template PictureSums ComparePlain(int, int, const double*, const double*, double, double*);

}  // namespace regrade
