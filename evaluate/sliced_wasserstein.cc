#include "evaluate/sliced_wasserstein.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/base/random.h"

namespace regrade {
namespace {

constexpr int kDirections = 64;
constexpr int kQuantileBins = 4096;
constexpr int kLevels = 1024;
constexpr int64_t kMaxPixels = 65536;  // per image
constexpr uint64_t kDirectionSeed = 2023;
const double kExtent = std::sqrt(3.0);  // |d . rgb| for rgb in the unit cube

// Uniform on the sphere: z and the angle around it are uniform (Archimedes).
std::array<Vec3d, kDirections> MakeDirections() {
  std::array<Vec3d, kDirections> directions;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 2 * RandomDouble(kDirectionSeed, 0, i) - 1;
    const double angle = 2 * M_PI * RandomDouble(kDirectionSeed, 1, i);
    const double r = std::sqrt(1 - z * z);
    directions[i] = {r * std::cos(angle), r * std::sin(angle), z};
  }
  return directions;
}

const std::array<Vec3d, kDirections>& Directions() {
  static const std::array<Vec3d, kDirections> directions = MakeDirections();
  return directions;
}

}  // namespace

ColourSlices& ColourSlices::operator+=(const ColourSlices& o) {
  if (o.bins_.empty()) return *this;
  bins_.resize(o.bins_.size());
  for (size_t i = 0; i < bins_.size(); ++i) bins_[i] += o.bins_[i];
  count_ += o.count_;
  return *this;
}

void ColourSlices::Add(const Image& image) {
  int stride = 1;
  const auto sampled = [&](int size) { return (size + stride - 1) / stride; };
  while (static_cast<int64_t>(sampled(image.width)) * sampled(image.height) > kMaxPixels)
    ++stride;
  std::vector<Vec3d> colours;
  for (int y = 0; y < image.height; y += stride)
    for (int x = 0; x < image.width; x += stride) {
      const float* p = image.at(x, y);
      const bool colour = image.channels >= 3;
      const Vec3d rgb = colour ? Vec3d{p[0], p[1], p[2]} : Vec3d{p[0], p[0], p[0]};
      if (!AllFinite(rgb)) continue;
      colours.push_back({std::clamp(rgb.x, 0.0, 1.0), std::clamp(rgb.y, 0.0, 1.0),
                         std::clamp(rgb.z, 0.0, 1.0)});
    }
  bins_.resize(static_cast<size_t>(kDirections) * kQuantileBins);
#pragma omp parallel for schedule(static)
  for (int d = 0; d < kDirections; ++d) {
    const Vec3d direction = Directions()[d];
    int64_t* bins = &bins_[static_cast<size_t>(d) * kQuantileBins];
    // In blocks, so that positions are computed several at a time.
    constexpr size_t kBlock = 256;
    std::array<int, kBlock> bin;
    for (size_t begin = 0; begin < colours.size(); begin += kBlock) {
      const size_t count = std::min(kBlock, colours.size() - begin);
      for (size_t i = 0; i < count; ++i) {
        const double position =
            (Dot(direction, colours[begin + i]) + kExtent) / (2 * kExtent) * kQuantileBins;
        bin[i] = std::clamp(static_cast<int>(position), 0, kQuantileBins - 1);
      }
      for (size_t i = 0; i < count; ++i) ++bins[bin[i]];
    }
  }
  count_ += std::ssize(colours);
}

std::vector<double> ColourSlices::Quantiles(int direction) const {
  const int64_t* bins = &bins_[static_cast<size_t>(direction) * kQuantileBins];
  std::vector<double> quantiles(kLevels);
  int bin = 0;
  int64_t below = 0;  // pixels in bins before `bin`
  for (int k = 0; k < kLevels; ++k) {
    const double rank = (k + 0.5) / kLevels * static_cast<double>(count_);
    while (bin + 1 < kQuantileBins && static_cast<double>(below + bins[bin]) < rank)
      below += bins[bin++];
    const double within = (rank - static_cast<double>(below)) / static_cast<double>(bins[bin]);
    quantiles[k] = (bin + within) / kQuantileBins * 2 * kExtent - kExtent;
  }
  return quantiles;
}

std::optional<double> SlicedWasserstein(const ColourSlices& a, const ColourSlices& b) {
  if (a.count_ == 0 || b.count_ == 0) return std::nullopt;
  double sum = 0;
  for (int d = 0; d < kDirections; ++d) {
    const std::vector<double> qa = a.Quantiles(d), qb = b.Quantiles(d);
    for (int k = 0; k < kLevels; ++k) sum += (qa[k] - qb[k]) * (qa[k] - qb[k]);
  }
  return std::sqrt(sum / (kDirections * static_cast<double>(kLevels)));
}

}  // namespace regrade
