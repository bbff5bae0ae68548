#include "stylize/image/guided_filter.h"

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"

namespace regrade {
namespace {

using Plane = std::vector<double>;

// ... c b a | a b c ... n | n ...
int Reflected(int i, int n) {
  i %= 2 * n;
  if (i < 0) i += 2 * n;
  return i < n ? i : 2 * n - 1 - i;
}

// Mean over windows, in place: running sums along rows, then along columns.
void BoxMean(Plane* plane, int width, int height, int radius) {
  Plane rows(plane->size());
  for (int y = 0; y < height; ++y) {
    const double* p = &(*plane)[static_cast<size_t>(y) * width];
    double* q = &rows[static_cast<size_t>(y) * width];
    double sum = 0;
    for (int k = -radius; k <= radius; ++k) sum += p[Reflected(k, width)];
    for (int x = 0; x < width; ++x) {
      q[x] = sum;
      sum += p[Reflected(x + radius + 1, width)] - p[Reflected(x - radius, width)];
    }
  }
  const auto row = [&](int y) {
    return &rows[static_cast<size_t>(Reflected(y, height)) * width];
  };
  const double scale = 1.0 / ((2.0 * radius + 1) * (2.0 * radius + 1));
  Plane sums(static_cast<size_t>(width));
  for (int k = -radius; k <= radius; ++k)
    for (int x = 0; x < width; ++x) sums[x] += row(k)[x];
  for (int y = 0; y < height; ++y) {
    double* q = &(*plane)[static_cast<size_t>(y) * width];
    const double *enters = row(y + radius + 1), *leaves = row(y - radius);
    for (int x = 0; x < width; ++x) {
      q[x] = sums[x] * scale;
      sums[x] += enters[x] - leaves[x];
    }
  }
}

template <typename Planes>
void BoxMeans(Planes* planes, int width, int height, int radius) {
#pragma omp parallel for schedule(dynamic)
  for (size_t i = 0; i < planes->size(); ++i) BoxMean(&(*planes)[i], width, height, radius);
}

// Planes of the statistics: I 0..2, p 3..5, I I^T 6..11 (upper triangle), I p^T 12..20.
constexpr int kPairs[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};

}  // namespace

GuidedCoefficients FitGuided(const Image& guide, const Image& picture, int radius, double eps) {
  REGRADE_CHECK(guide.SameSize(picture) && guide.channels == 3 && picture.channels == 3);
  REGRADE_CHECK(!guide.empty());
  REGRADE_CHECK_GT(eps, 0);
  const int width = guide.width, height = guide.height;
  const int64_t count = guide.num_pixels();
  std::array<Plane, 21> means;
  for (Plane& plane : means) plane.resize(count);
  for (int64_t i = 0; i < count; ++i) {
    const float *g = &guide.pixels[3 * i], *p = &picture.pixels[3 * i];
    for (int c = 0; c < 3; ++c) {
      means[c][i] = g[c];
      means[3 + c][i] = p[c];
      for (int d = 0; d < 3; ++d) means[12 + 3 * c + d][i] = static_cast<double>(g[c]) * p[d];
    }
    for (int k = 0; k < 6; ++k)
      means[6 + k][i] = static_cast<double>(g[kPairs[k][0]]) * g[kPairs[k][1]];
  }
  BoxMeans(&means, width, height, radius);

  // Means of products less products of means: in double, of values near [0, 1], their rounding
  // of 1e-15 is nothing beside eps.
  std::array<Plane, 12> fits;  // 3 c + d: of guide channel c for output d; 9 + d: offset
  for (Plane& plane : fits) plane.resize(count);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < count; ++i) {
    Eigen::Matrix3d sigma, cross;
    const Eigen::Vector3d m(means[0][i], means[1][i], means[2][i]);
    const Eigen::Vector3d n(means[3][i], means[4][i], means[5][i]);
    for (int k = 0; k < 6; ++k) {
      const int c = kPairs[k][0], d = kPairs[k][1];
      sigma(c, d) = sigma(d, c) = means[6 + k][i] - m[c] * m[d] + (c == d ? eps : 0);
    }
    for (int c = 0; c < 3; ++c)
      for (int d = 0; d < 3; ++d) cross(c, d) = means[12 + 3 * c + d][i] - m[c] * n[d];
    const Eigen::Matrix3d a = sigma.llt().solve(cross);
    const Eigen::Vector3d b = n - a.transpose() * m;
    for (int d = 0; d < 3; ++d) {
      for (int c = 0; c < 3; ++c) fits[3 * c + d][i] = a(c, d);
      fits[9 + d][i] = b[d];
    }
  }
  BoxMeans(&fits, width, height, radius);

  GuidedCoefficients result;
  Image* parts[] = {&result.of_red, &result.of_green, &result.of_blue, &result.offset};
  for (int k = 0; k < 4; ++k) {
    *parts[k] = Image(width, height);
    for (int64_t i = 0; i < count; ++i)
      for (int d = 0; d < 3; ++d)
        parts[k]->pixels[3 * i + d] = static_cast<float>(fits[3 * k + d][i]);
  }
  return result;
}

Image ApplyGuided(const GuidedCoefficients& coefficients, const Image& guide) {
  REGRADE_CHECK_EQ(guide.channels, 3);
  const auto enlarged = [&](const Image& part) {
    return part.SameSize(guide) ? part : Resize(part, guide.width, guide.height);
  };
  const Image red = enlarged(coefficients.of_red), green = enlarged(coefficients.of_green),
              blue = enlarged(coefficients.of_blue), offset = enlarged(coefficients.offset);
  Image result(guide.width, guide.height);
  for (int64_t i = 0; i < guide.num_pixels(); ++i) {
    const float* g = &guide.pixels[3 * i];
    for (int64_t k = 3 * i; k < 3 * i + 3; ++k)
      result.pixels[k] = red.pixels[k] * g[0] + green.pixels[k] * g[1] + blue.pixels[k] * g[2] +
                         offset.pixels[k];
  }
  return result;
}

}  // namespace regrade
