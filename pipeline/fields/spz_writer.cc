#include "pipeline/fields/spz_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/base/quantile.h"
#include "kernels/splats/covariance.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/morton_order.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/byte_packing.h"
#include "pipeline/files/deflate.h"

namespace regrade {
namespace {

constexpr uint32_t kWrittenVersion = 3;
constexpr int kMostBits = 24;  // behind the point of a position
// Of the harmonics' bytes. Of 60,000 splats of degree 3 (a phone's video of a fox) that are
// 26 bytes a splat and renders 40.7 dB from the exact ones; steps of 8 and 16, Niantic's, are
// 22 bytes and 33.2 dB.
constexpr int kStepOf1 = 4, kStepOfOthers = 8;

uint8_t ToByte(double value) {
  return static_cast<uint8_t>(std::clamp(std::round(value), 0.0, 255.0));
}

// Positions share one step, a 2^23rd of the farthest at best: a single splat far outside would
// make all of them coarse. Those that are so many times farther from the middle than half of
// the splats are drawn in to there and made as much smaller: from the middle they look the
// same.
constexpr double kReach = 100;

struct Reach {
  Vec3d middle;
  double most;  // from there

  explicit Reach(const Splats& splats) {
    std::vector<double> along(splats.count());
    for (int a = 0; a < 3; ++a) {
      for (size_t i = 0; i < along.size(); ++i) along[i] = splats.mean[3 * i + a];
      middle[a] = Median(along);
    }
    for (size_t i = 0; i < along.size(); ++i) along[i] = Norm(Mean(splats, i) - middle);
    most = kReach * Median(along);
  }
  static Vec3d Mean(const Splats& splats, size_t i) {
    return {splats.mean[3 * i], splats.mean[3 * i + 1], splats.mean[3 * i + 2]};
  }
  // How much nearer a splat is drawn; at most 1.
  double ShareOf(const Vec3d& mean) const {
    const double distance = Norm(mean - middle);
    return most > 0 && distance > most ? most / distance : 1;
  }
  Vec3d Within(const Vec3d& mean) const { return middle + (mean - middle) * ShareOf(mean); }
};

int FractionalBits(const Splats& splats, const Reach& reach) {
  double farthest = 0;
  for (int64_t i = 0; i < splats.count(); ++i) {
    const Vec3d mean = reach.Within(Reach::Mean(splats, i));
    for (int a = 0; a < 3; ++a) farthest = std::max(farthest, std::abs(mean[a]));
  }
  int bits = kMostBits;
  while (bits > 0 && std::ldexp(farthest, bits) >= 8388607) --bits;
  return bits;
}

void AppendPosition(const Vec3f& mean, int bits, std::string* bytes) {
  for (int a = 0; a < 3; ++a) {
    const double fixed =
        std::clamp(std::round(std::ldexp(double{mean[a]}, bits)), -8388608.0, 8388607.0);
    const auto packed = static_cast<uint32_t>(static_cast<int32_t>(fixed));
    for (int shift = 0; shift < 24; shift += 8)
      bytes->push_back(static_cast<char>(packed >> shift));
  }
}

uint32_t PackSmallestThree(const float* wxyz) {
  float unit[4];
  UnitQuaternion(wxyz, unit);
  const double xyzw[4] = {unit[1], unit[2], unit[3], unit[0]};
  uint32_t largest = 0;
  for (uint32_t a = 1; a < 4; ++a)
    if (std::abs(xyzw[a]) > std::abs(xyzw[largest])) largest = a;
  uint32_t packed = largest;
  for (uint32_t a = 0; a < 4; ++a) {
    if (a == largest) continue;
    const double share = std::min(std::abs(xyzw[a]) / std::sqrt(0.5), 1.0);
    const bool negative = (xyzw[a] < 0) != (xyzw[largest] < 0);
    packed = packed << 10 | static_cast<uint32_t>(negative) << 9 |
             static_cast<uint32_t>(std::lround(share * 511));
  }
  return packed;
}

// A multiple of `step`, which fewer bits hold once it is packed.
uint8_t HarmonicByte(float value, int step) {
  return static_cast<uint8_t>(
      std::clamp(128 + step * std::lround(128.0 * double{value} / step), 0L, 255L));
}

}  // namespace

void WriteSpz(const std::string& path, const Splats& splats, bool antialiased) {
  const Reach reach(splats);
  const int bits = FractionalBits(splats, reach), basis = splats.basis;
  BytePacker header;
  header.Value(uint32_t{0x5053474e});  // NGSP
  header.Value(kWrittenVersion);
  header.Value(static_cast<uint32_t>(splats.count()));
  const int degree = static_cast<int>(std::lround(std::sqrt(basis))) - 1;
  for (const int byte : {degree, bits, int{antialiased}, 0})
    header.Value(static_cast<uint8_t>(byte));

  const SplatTurn turn(HalfTurnAboutX());
  std::string positions, opacities, colors, scales, rotations, harmonics;
  for (const int64_t i : MortonOrder(splats.view())) {
    ColoredSplat record = SplatAt(splats.view(), i);
    const Vec3d mean = record.splat.mean.Cast<double>();
    if (const double share = reach.ShareOf(mean); share < 1) {
      record.splat.mean = reach.Within(mean).Cast<float>();
      for (int a = 0; a < 3; ++a)
        record.splat.log_scale[a] += static_cast<float>(std::log(share));
    }
    turn.Apply(basis, &record);
    AppendPosition(record.splat.mean, bits, &positions);
    opacities.push_back(
        static_cast<char>(ToByte(255 / (1 + std::exp(-double{record.splat.opacity_logit})))));
    for (int a = 0; a < 3; ++a) {
      colors.push_back(
          static_cast<char>(ToByte(255 * (0.15 * double{record.sh[a * basis]} + 0.5))));
      scales.push_back(
          static_cast<char>(ToByte(16 * (double{record.splat.log_scale[a]} + 10))));
    }
    const uint32_t rotation = PackSmallestThree(record.splat.quaternion);
    for (int shift = 0; shift < 32; shift += 8)
      rotations.push_back(static_cast<char>(rotation >> shift));
    for (int k = 1; k < basis; ++k)
      for (int c = 0; c < 3; ++c)
        harmonics.push_back(static_cast<char>(HarmonicByte(
            record.sh[c * basis + k], k < BasisOfDegree(1) ? kStepOf1 : kStepOfOthers)));
  }
  WriteFileAtomically(path, Gzip(header.Joined() + positions + opacities + colors + scales +
                                 rotations + harmonics));
}

}  // namespace regrade
