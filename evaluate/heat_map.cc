#include "evaluate/heat_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/warp.h"

namespace regrade {
namespace {

using Colour = std::array<float, 3>;

// White, yellow, red, dark red; lightness decreases monotonically.
constexpr Colour kRamp[] = {{1, 1, 1}, {1, 0.85f, 0.3f}, {0.9f, 0.25f, 0.1f}, {0.4f, 0, 0.2f}};
constexpr float kMaskedBrightness = 0.25f;

// `heat` in [0, 1].
Colour RampColour(double heat) {
  const double at = heat * (std::size(kRamp) - 1);
  const size_t below = std::min(static_cast<size_t>(at), std::size(kRamp) - 2);
  const float t = static_cast<float>(at - static_cast<double>(below));
  Colour colour;
  for (size_t c = 0; c < 3; ++c)
    colour[c] = kRamp[below][c] + t * (kRamp[below + 1][c] - kRamp[below][c]);
  return colour;
}

double Heat(double squared_error) {
  if (!(squared_error > 0)) return 0;
  const double db = -10 * std::log10(squared_error);
  return std::clamp((kHeatWhiteDb - db) / (kHeatWhiteDb - kHeatDarkDb), 0.0, 1.0);
}

}  // namespace

Image ErrorHeatMap(const Image& at, const Image& warped, const PairMotion& motion) {
  const FlowField& flow = motion.flow;
  REGRADE_CHECK(at.SameSize(warped) && at.SameSize(motion.mask.weight));
  const int channels = std::min({at.channels, warped.channels, 3});
  Image map(at.width, at.height, 3);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      const float* f = flow.at(x, y);
      const BilinearTaps taps = TapsAt(x + static_cast<double>(f[0]),
                                       y + static_cast<double>(f[1]), flow.width, flow.height);
      double squared = 0, grey = 0;
      for (int c = 0; c < channels; ++c) {
        const double value = at.at(x, y)[c];
        squared += std::pow(Sample(taps, warped, c) - value, 2) / channels;
        grey += value / channels;
      }
      const bool trusted = *motion.mask.weight.at(x, y) >= 0.5f && std::isfinite(squared);
      const float dim = std::isfinite(grey) ? kMaskedBrightness * static_cast<float>(grey) : 0;
      const Colour colour = trusted ? RampColour(Heat(squared)) : Colour{dim, dim, dim};
      std::copy(colour.begin(), colour.end(), map.at(x, y));
    }
  return map;
}

std::string HeatMapFileName(const PairResult& pair) {
  return Format("%s_gap%d_%05d.png", pair.sequence.c_str(), pair.to - pair.from, pair.from);
}

}  // namespace regrade
