// Distance between the colour distributions of two sets of images.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// Histograms of RGB values, clipped to [0, 1], along 64 fixed directions. Only counts are
// stored, so memory is constant and the order of images does not matter.
class ColourSlices {
 public:
  // Pixels with non-finite values are skipped. An image above 65536 pixels is sampled on a
  // regular grid of at most that many.
  void Add(const Image& image);
  ColourSlices& operator+=(const ColourSlices& o);
  int64_t count() const { return count_; }

 private:
  friend std::optional<double> SlicedWasserstein(const ColourSlices&, const ColourSlices&);
  std::vector<double> Quantiles(int direction) const;

  std::vector<int64_t> bins_;  // [directions, bins]; empty before the first pixel
  int64_t count_ = 0;
};

// EQ(sliced-wasserstein), the sliced 2-Wasserstein distance: sqrt(mean over directions d and
// levels q of (Q_a,d(q) - Q_b,d(q))^2) in units of the [0, 1] range, with quantiles Q of the
// projections d . rgb at 1024 levels (k + 1/2) / 1024. The 64 unit directions are uniform on
// the sphere with a fixed seed. Projections are binned to 1 / 1182, linear inside a bin. Two
// single colours at distance r give about r / sqrt(3). Empty if either set is empty.
std::optional<double> SlicedWasserstein(const ColourSlices& a, const ColourSlices& b);

}  // namespace regrade
