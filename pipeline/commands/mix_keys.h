// The weight of each style over the time of a film.
#pragma once

#include <string>
#include <vector>

namespace regrade {

// Key points at equal distances in time, each with a weight for each style.
struct MixKeys {
  std::vector<std::vector<double>> points;

  // Weights at `time` in [0, 1]: linear between key points, and exactly theirs at key points.
  std::vector<double> At(double time) const;
  bool IsConstant() const;
};

// "0:1" goes from the unstyled scene to the style; "0,0:1,0:0,1" via a first style to a second;
// "0.5" is half of the style throughout. Weights of a point are in [0, 1] and add up to at most
// 1; the remainder is the weight of the unstyled scene. Empty text goes from the unstyled scene
// through all styles in order. Throws Error(kUsage) that names the point.
MixKeys ParseMixKeys(const std::string& text, int styles);

}  // namespace regrade
