// Distance between the colours of two sets of pictures, wherever in the pictures they are.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade {

// Distribution of RGB values, clipped to [0, 1], along 64 fixed directions. Holds counts only,
// so any number of pixels fits and their order does not matter.
class ColourSlices {
 public:
  ColourSlices();
  // Pixels that are not finite are skipped. A picture above 65536 pixels is sampled on a
  // regular grid of at most that many.
  void Add(const Image& image);
  int64_t count() const { return count_; }

 private:
  friend std::optional<double> SlicedWasserstein(const ColourSlices&, const ColourSlices&);
  std::vector<double> Quantiles(int direction) const;

  std::vector<int64_t> bins_;  // [directions, bins]
  int64_t count_ = 0;
};

// EQ(sliced-wasserstein): sqrt(mean over directions d and levels q of (Q_a,d(q) - Q_b,d(q))^2),
// the sliced 2-Wasserstein distance in units of the [0, 1] range, by matching quantiles Q at
// 1024 levels (k + 1/2) / 1024 of the projections d . rgb. The 64 unit directions are uniform
// on the sphere with a fixed seed. Projections are binned to 1 / 1182, linear inside a bin. Two
// colours at distance r alone give about r / sqrt(3). Empty when either set is empty.
std::optional<double> SlicedWasserstein(const ColourSlices& a, const ColourSlices& b);

}  // namespace regrade
