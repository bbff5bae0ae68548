// How much of each style a film shows, from its beginning to its end.
#pragma once

#include <string>
#include <vector>

namespace regrade {

// Key points at equal distances in time, each with one share for each style.
struct MixKeys {
  std::vector<std::vector<double>> points;

  // Shares at `time` in [0, 1]: linear between key points, and at one of them its own shares to
  // the bit.
  std::vector<double> At(double time) const;
  bool IsConstant() const;
};

// "0:1" is from the scene as it was to the style; "0,0:1,0:0,1" by way of a first style to a
// second; "0.5" is half of the style throughout. Shares of a point are in [0, 1] and add up to
// at most 1; what is missing to 1 is the scene as it was. Empty text goes from the scene as it
// was through all styles in order. Throws Error(kUsage) that names the point.
MixKeys ParseMixKeys(const std::string& text, int styles);

}  // namespace regrade
