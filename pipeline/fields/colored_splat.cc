#include "pipeline/fields/colored_splat.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/covariance.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

ColoredSplat SplatAt(const SplatsView<float>& splats, int64_t i) {
  ColoredSplat record{splats[i], {}};
  std::copy_n(splats.Coefficients(i), 3 * splats.basis, record.sh);
  return record;
}

float LogitOfByte(int byte) {
  const double opacity = std::clamp(byte / 255.0, 0.25 / 255, 1 - 0.25 / 255);
  return static_cast<float>(std::log(opacity / (1 - opacity)));
}

bool CleanRecord(int basis, ColoredSplat* record) {
  Splat<float>& splat = record->splat;
  if (std::abs(splat.opacity_logit) > kMostLogit)
    splat.opacity_logit = std::copysign(kMostLogit, splat.opacity_logit);
  for (int a = 0; a < 3; ++a) {
    constexpr float kMost = static_cast<float>(kMaxLogScale);
    if (splat.log_scale[a] > kMost) return false;
    if (splat.log_scale[a] < -kMost) splat.log_scale[a] = -kMost;
  }
  float unit[4];
  if (UnitQuaternion(splat.quaternion, unit) == 0 &&
      std::ranges::none_of(splat.quaternion, [](float q) { return std::isnan(q); }))
    std::copy_n(unit, 4, splat.quaternion);
  const SplatsView<float> view{
      &splat.mean.x, &splat.log_scale.x, splat.quaternion, &splat.opacity_logit, record->sh, 1,
      basis};
  return IsUsable(view, 0);
}

std::array<double, 4> QuaternionProduct(const std::array<double, 4>& a,
                                        const std::array<double, 4>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

SplatTurn::SplatTurn(const Mat3d& to_from_file)
    : matrix_(to_from_file), harmonics_(RotateHarmonics(to_from_file)) {
  // A Gaussian does not change where all its axes are reversed.
  Mat3d rotation = matrix_;
  if (rotation.Determinant() < 0)
    for (Vec3d& row : rotation.row) row = -row;
  quaternion_ = QuaternionOf(rotation);
}

void SplatTurn::Apply(int basis, ColoredSplat* record) const {
  Splat<float>& splat = record->splat;
  splat.mean = (matrix_ * splat.mean.Cast<double>()).Cast<float>();
  const std::array<double, 4> turned = QuaternionProduct(
      quaternion_,
      {splat.quaternion[0], splat.quaternion[1], splat.quaternion[2], splat.quaternion[3]});
  std::copy(turned.begin(), turned.end(), splat.quaternion);
  float sh[3 * kMaxBasis];
  std::copy_n(record->sh, 3 * basis, sh);
  for (int channel = 0; channel < 3; ++channel)
    for (int degree = 1; BasisOfDegree(degree - 1) < basis; ++degree)
      for (int k = BasisOfDegree(degree - 1); k < BasisOfDegree(degree); ++k) {
        double sum = 0;
        for (int j = BasisOfDegree(degree - 1); j < BasisOfDegree(degree); ++j)
          sum += harmonics_[static_cast<size_t>(k)][static_cast<size_t>(j)] *
                 double{sh[channel * basis + j]};
        record->sh[channel * basis + k] = static_cast<float>(sum);
      }
}

SplatCollector::SplatCollector(uint64_t records, int basis, uint64_t file_bytes,
                               uint64_t budget, std::string where)
    : where_(std::move(where)) {
  if (records == 0) throw InputError("there are no splats", where_);
  const uint64_t values = 3 + 3 + 4 + 1 + 3 * static_cast<uint64_t>(basis);
  const double needed =
      static_cast<double>(records) * static_cast<double>(values) * sizeof(float) +
      static_cast<double>(file_bytes);
  if (records > INT32_MAX || needed > static_cast<double>(budget))
    throw InputError(
        Concat(records, " splats need ", Format("%.1f GB", needed / 1e9), " of memory, above ",
               Format("%.1f GB", static_cast<double>(budget) / 1e9)),
        where_, "give more memory, or take fewer splats (`splat-transform --decimate`)");
  Splats& splats = scene_.splats;
  splats.basis = basis;
  splats.mean.reserve(3 * records);
  splats.log_scale.reserve(3 * records);
  splats.quaternion.reserve(4 * records);
  splats.opacity_logit.reserve(records);
  splats.sh.reserve(3 * static_cast<size_t>(basis) * records);
}

void SplatCollector::Add(ColoredSplat record) {
  const int64_t index = scene_.records++;
  if (!CleanRecord(basis(), &record)) {
    if (scene_.dropped++ == 0) scene_.first_dropped = index;
    return;
  }
  const Splat<float>& splat = record.splat;
  Splats& splats = scene_.splats;
  for (int a = 0; a < 3; ++a) {
    splats.mean.push_back(splat.mean[a]);
    splats.log_scale.push_back(splat.log_scale[a]);
  }
  splats.quaternion.insert(splats.quaternion.end(), splat.quaternion, splat.quaternion + 4);
  splats.opacity_logit.push_back(splat.opacity_logit);
  splats.sh.insert(splats.sh.end(), record.sh, record.sh + 3 * basis());
}

SplatScene SplatCollector::Finish() && {
  if (scene_.splats.count() == 0)
    throw InputError(Concat("none of its ", scene_.records,
                            " splats can be drawn: their values are not finite or too large"),
                     where_, "the file is damaged or was not written by a splat program");
  return std::move(scene_);
}

}  // namespace regrade
