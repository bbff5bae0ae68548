#include "kernels/image/color_statistics.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "kernels/base/error.h"
#include "kernels/image/row_sum.h"

namespace regrade {
namespace {

// Calls body(rgb) for each counted pixel of row y.
template <typename Body>
void ForCountedPixels(const Image& image, const Image* mask, int y, const Body& body) {
  const int green = image.channels >= 3 ? 1 : 0, blue = image.channels >= 3 ? 2 : 0;
  for (int x = 0; x < image.width; ++x) {
    const float* p = image.at(x, y);
    if (image.channels == 4 && !(p[3] > 0.5f)) continue;
    if (mask != nullptr && !(*mask->at(x, y) > 0.5f)) continue;
    const Vec3f rgb{p[0], p[green], p[blue]};
    if (AllFinite(rgb)) body(rgb);
  }
}

void CheckMask(const Image& image, const Image* mask) {
  if (mask == nullptr) return;
  REGRADE_CHECK_EQ(mask->channels, 1);
  if (!mask->SameSize(image))
    throw InputError(Concat("the mask is ", mask->width, "x", mask->height, ", its picture ",
                            image.width, "x", image.height),
                     "", "a mask must have the size of its picture");
}

[[noreturn]] void ThrowNoPixel() {
  throw InputError(
      "mask selects no pixel", "",
      "colours are measured where the mask is above 1/2, the picture is opaque and its "
      "values are finite");
}

// Sums of 8-bit values: exact, so their order does not matter. 64 bits hold 2.8e14 pixels.
struct IntegerSums {
  bool is_8_bit = true;
  uint64_t count = 0;
  uint64_t sum[3] = {};
  uint64_t product[3][3] = {};  // upper triangle

  void Add(const Vec3f& rgb) {
    uint32_t v[3];
    for (int c = 0; c < 3; ++c) {
      const float scaled = rgb[c] * 255.0f;
      if (!(scaled > -0.5f && scaled < 255.5f)) {
        is_8_bit = false;
        return;
      }
      v[c] = static_cast<uint32_t>(scaled + 0.5f);
      if (std::abs(scaled - static_cast<float>(v[c])) > 1e-4f) {
        is_8_bit = false;
        return;
      }
    }
    ++count;
    for (int i = 0; i < 3; ++i) {
      sum[i] += v[i];
      for (int j = i; j < 3; ++j) product[i][j] += v[i] * v[j];
    }
  }

  IntegerSums& operator+=(const IntegerSums& o) {
    is_8_bit = is_8_bit && o.is_8_bit;
    count += o.count;
    for (int i = 0; i < 3; ++i) {
      sum[i] += o.sum[i];
      for (int j = i; j < 3; ++j) product[i][j] += o.product[i][j];
    }
    return *this;
  }

  ColorStatistics Result() const {
    ColorStatistics result;
    result.count = static_cast<int64_t>(count);
    const double n = static_cast<double>(count);
    for (int i = 0; i < 3; ++i) {
      result.mean[i] = static_cast<double>(sum[i]) / (255.0 * n);
      for (int j = i; j < 3; ++j) {
        // n sum xy - sum x sum y: the difference that cancels is computed in integers.
        const __int128 difference = static_cast<__int128>(count) * product[i][j] -
                                    static_cast<__int128>(sum[i]) * sum[j];
        result.covariance(i, j) = result.covariance(j, i) =
            static_cast<double>(difference) / (n * n * (255.0 * 255.0));
      }
    }
    return result;
  }
};

struct MeanSums {
  int64_t count = 0;
  Vec3d sum{};
  MeanSums& operator+=(const MeanSums& o) {
    count += o.count;
    sum += o.sum;
    return *this;
  }
};

struct CentredSums {
  Mat3d product = kZeroMat3d;
  void Add(const Vec3d& d, double weight = 1) {
    for (int i = 0; i < 3; ++i) product.row[i] += d * (weight * d[i]);
  }
  CentredSums& operator+=(const CentredSums& o) {
    for (int i = 0; i < 3; ++i) product.row[i] += o.product.row[i];
    return *this;
  }
};

Vec3d Same(const Vec3d& srgb) { return srgb; }

Eigen::Matrix3d ToEigen(const Mat3d& m) {
  Eigen::Matrix3d result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result(i, j) = m(i, j);
  return result;
}

}  // namespace

ColorStatistics MeasureColor(const Image& image, const Image* mask) {
  CheckMask(image, mask);
  const IntegerSums sums = SumOverRows(image.height, [&](int y) {
    IntegerSums row;
    ForCountedPixels(image, mask, y, [&](const Vec3f& rgb) {
      if (row.is_8_bit) row.Add(rgb);
    });
    return row;
  });
  if (!sums.is_8_bit) return MeasureColor(image, Same, mask);
  if (sums.count == 0) ThrowNoPixel();
  return sums.Result();
}

ColorStatistics MeasureColor(const Image& image, Vec3d (*from_srgb)(const Vec3d&),
                             const Image* mask) {
  CheckMask(image, mask);
  const MeanSums means = SumOverRows(image.height, [&](int y) {
    MeanSums row;
    ForCountedPixels(image, mask, y, [&](const Vec3f& rgb) {
      row.sum += from_srgb(rgb.Cast<double>());
      ++row.count;
    });
    return row;
  });
  if (means.count == 0) ThrowNoPixel();
  ColorStatistics result;
  result.count = means.count;
  const double n = static_cast<double>(means.count);
  result.mean = means.sum / n;
  const CentredSums centred = SumOverRows(image.height, [&](int y) {
    CentredSums row;
    ForCountedPixels(image, mask, y, [&](const Vec3f& rgb) {
      row.Add(from_srgb(rgb.Cast<double>()) - result.mean);
    });
    return row;
  });
  for (int i = 0; i < 3; ++i) result.covariance.row[i] = centred.product.row[i] / n;
  return result;
}

ColorStatistics Pool(const std::vector<ColorStatistics>& parts) {
  ColorStatistics result;
  Vec3d origin{};
  for (const ColorStatistics& part : parts) {
    if (result.count == 0) origin = part.mean;
    result.count += part.count;
  }
  if (result.count == 0) ThrowNoPixel();
  const double n = static_cast<double>(result.count);
  // Relative to the first mean, so that equal means pool to exactly the same value.
  Vec3d shift{};
  for (const ColorStatistics& part : parts)
    shift += (part.mean - origin) * static_cast<double>(part.count);
  result.mean = origin + shift / n;
  CentredSums sums;
  for (const ColorStatistics& part : parts) {
    const double weight = static_cast<double>(part.count) / n;
    sums.Add(part.mean - result.mean, weight);
    for (int i = 0; i < 3; ++i) sums.product.row[i] += part.covariance.row[i] * weight;
  }
  result.covariance = sums.product;
  return result;
}

EigenSystem SymmetricEigen(const Mat3d& m) {
  const Eigen::Matrix3d matrix = ToEigen(m);
  REGRADE_CHECK(matrix.allFinite());
  // The solver reads one triangle only.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 *
                                                              (matrix + matrix.transpose()));
  REGRADE_CHECK(solver.info() == Eigen::Success && solver.eigenvalues().allFinite() &&
                solver.eigenvectors().allFinite());
  EigenSystem result;
  for (int i = 0; i < 3; ++i) {
    result.values[i] = solver.eigenvalues()(i);
    for (int j = 0; j < 3; ++j) result.vectors(i, j) = solver.eigenvectors()(i, j);
  }
  return result;
}

EigenSystem CovarianceEigen(const Mat3d& covariance) {
  EigenSystem result = SymmetricEigen(covariance);
  const double rounding = 64 * std::numeric_limits<double>::epsilon() *
                          std::max(std::abs(result.values.x), std::abs(result.values.z));
  for (int i = 0; i < 3; ++i) {
    REGRADE_CHECK_GE(result.values[i], -rounding);
    if (result.values[i] <= rounding) result.values[i] = 0;
  }
  return result;
}

}  // namespace regrade
