// Colourfulness of images: mean chroma and the spread of hues.
#pragma once

#include <cstdint>
#include <optional>

#include "kernels/scene/image.h"

namespace regrade {

// EQ(hue-chroma): over all pixels added, with CIELAB chroma c and hue h (sRGB clipped to [0,
// 1], D65 white): R = |sum c exp(i h)| / sum c. Sums are in double; pixels with non-finite
// values are skipped, and those where `mask` (one channel, same size; may be null) is 1/2 or
// less.
class HueChroma {
 public:
  void Add(const Image& image, const Image* mask = nullptr);

  // sqrt(-2 ln R) in radians: the circular standard deviation of hue, weighted by chroma. 0 for
  // a single hue; empty for grey images (mean chroma below 1e-4).
  std::optional<double> HueStd() const;
  // Mean c in CIELAB units; empty without pixels.
  std::optional<double> MeanChroma() const;

  HueChroma& operator+=(const HueChroma& o);

 private:
  double sum_a_ = 0, sum_b_ = 0, sum_chroma_ = 0;  // c exp(ih) = a + ib
  int64_t count_ = 0;
};

}  // namespace regrade
