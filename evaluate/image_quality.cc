#include "evaluate/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "evaluate/frame_pairs.h"
#include "kernels/base/error.h"
#include "kernels/image/row_sum.h"

namespace regrade {
namespace {

void CheckSameKind(const Image& a, const Image& b) {
  REGRADE_CHECK(a.SameSize(b));
  REGRADE_CHECK_EQ(ColourChannels(a), ColourChannels(b));
}

struct Mean {
  double sum = 0;
  int64_t count = 0;
  Mean& operator+=(const Mean& o) {
    sum += o.sum;
    count += o.count;
    return *this;
  }
  void Add(double value) {
    if (!std::isfinite(value)) return;
    sum += value;
    ++count;
  }
  std::optional<double> Value() const {
    if (count == 0) return std::nullopt;
    return sum / static_cast<double>(count);
  }
};

constexpr int kWindow = 11;
using Kernel = std::array<double, kWindow>;

Kernel SsimKernel() {
  Kernel kernel;
  double sum = 0;
  for (int i = 0; i < kWindow; ++i) {
    const double k = i - kWindow / 2;
    sum += kernel[i] = std::exp(-k * k / (2 * 1.5 * 1.5));
  }
  for (double& tap : kernel) tap /= sum;
  return kernel;
}

struct Moments {
  double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  void Add(double w, const Moments& o) {
    a += w * o.a, b += w * o.b, aa += w * o.aa, bb += w * o.bb, ab += w * o.ab;
  }
};

double SsimOf(const Moments& m) {
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  // E[x^2] - E[x]^2 cancels, but values near 1 leave it 1e-16 in double, far below c2.
  const double var_a = m.aa - m.a * m.a, var_b = m.bb - m.b * m.b, cov = m.ab - m.a * m.b;
  return (2 * m.a * m.b + c1) * (2 * cov + c2) /
         ((m.a * m.a + m.b * m.b + c1) * (var_a + var_b + c2));
}

double Grey(const Image& image, int x, int y) {
  double sum = 0;
  for (int c = 0; c < ColourChannels(image); ++c) sum += image.at(x, y)[c];
  return sum / ColourChannels(image);
}

// The gradient's length at each pixel but those of the last row and column, row by row; their
// mean.
struct Gradients {
  std::vector<double> length;
  std::optional<double> mean;

  explicit Gradients(const Image& image)
      : length(static_cast<size_t>(image.width - 1) * static_cast<size_t>(image.height - 1)) {
    const auto sums = SumOverRows(image.height - 1, [&](int y) {
      Mean row;
      double* out =
          length.data() + static_cast<size_t>(y) * static_cast<size_t>(image.width - 1);
      double here = Grey(image, 0, y);
      for (int x = 0; x + 1 < image.width; ++x) {
        const double right = Grey(image, x + 1, y);
        const double dx = right - here, dy = Grey(image, x, y + 1) - here;
        out[x] = std::sqrt(dx * dx + dy * dy);
        row.Add(out[x]);
        here = right;
      }
      return row;
    });
    mean = sums.Value();
  }
};

struct Covariance {
  double aa = 0, bb = 0, ab = 0;
  Covariance& operator+=(const Covariance& o) {
    aa += o.aa, bb += o.bb, ab += o.ab;
    return *this;
  }
};

}  // namespace

std::optional<double> MeanSquaredError(const Image& a, const Image& b, const Image* left_out) {
  CheckSameKind(a, b);
  if (left_out != nullptr) REGRADE_CHECK(a.SameSize(*left_out));
  const int channels = ColourChannels(a);
  const Mean pixels = SumOverRows(a.height, [&](int y) {
    Mean row;
    for (int x = 0; x < a.width; ++x) {
      if (left_out != nullptr && *left_out->at(x, y) > 0.5f) continue;
      double squared = 0;
      for (int c = 0; c < channels; ++c) {
        const double d = static_cast<double>(a.at(x, y)[c]) - b.at(x, y)[c];
        squared += d * d;
      }
      row.Add(squared / channels);
    }
    return row;
  });
  return pixels.Value();
}

std::optional<double> Psnr(const Image& a, const Image& b, const Image* left_out) {
  const std::optional<double> error = MeanSquaredError(a, b, left_out);
  if (!error) return std::nullopt;
  return *error > 0 ? -10 * std::log10(*error) : std::numeric_limits<double>::infinity();
}

std::optional<double> Ssim(const Image& a, const Image& b) {
  CheckSameKind(a, b);
  const int width = a.width - kWindow + 1, height = a.height - kWindow + 1;
  if (width < 1 || height < 1) return std::nullopt;
  const Kernel kernel = SsimKernel();
  const int channels = ColourChannels(a);
  const Mean windows = SumOverRows(height, [&](int y) {
    Mean row;
    std::vector<Moments> columns(a.width);
    for (int c = 0; c < channels; ++c) {
      for (int x = 0; x < a.width; ++x) {
        columns[x] = {};
        for (int k = 0; k < kWindow; ++k) {
          const double u = a.at(x, y + k)[c], v = b.at(x, y + k)[c];
          columns[x].Add(kernel[k], {u, v, u * u, v * v, u * v});
        }
      }
      for (int x = 0; x < width; ++x) {
        Moments m;
        for (int k = 0; k < kWindow; ++k) m.Add(kernel[k], columns[x + k]);
        row.Add(SsimOf(m));
      }
    }
    return row;
  });
  return windows.Value();
}

std::optional<double> GradientCorrelation(const Image& a, const Image& b) {
  CheckSameKind(a, b);
  if (a.width < 2 || a.height < 2) return std::nullopt;
  // Two passes: the one-pass variance cancels.
  const Gradients of_a(a), of_b(b);
  if (!of_a.mean || !of_b.mean) return std::nullopt;
  const size_t width = static_cast<size_t>(a.width - 1);
  const Covariance sum = SumOverRows(a.height - 1, [&](int y) {
    Covariance row;
    for (size_t i = static_cast<size_t>(y) * width; i < static_cast<size_t>(y + 1) * width;
         ++i) {
      const double da = of_a.length[i] - *of_a.mean, db = of_b.length[i] - *of_b.mean;
      if (std::isfinite(da) && std::isfinite(db)) row += {da * da, db * db, da * db};
    }
    return row;
  });
  const double scale = std::sqrt(sum.aa) * std::sqrt(sum.bb);
  if (!(scale > 0)) return std::nullopt;
  return std::clamp(sum.ab / scale, -1.0, 1.0);
}

}  // namespace regrade
