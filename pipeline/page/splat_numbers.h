// Splats as whole numbers, as a page has them, and their order in it.
//
// EQ(page-splat): of splat i, with steps that are constants,
//   position  p / kPositionStep, p in [-2, 2], see EQ(splat-position): steps inside the box are
//             all alike, and outside of it as far apart as directions from its middle
//   scale     l / kLogScaleStep of the logarithms of the scales
//   rotation  (x, y, z) / kRotationStep of the quaternion whose w is the largest component, so
//             that w = sqrt(1 - x^2 - y^2 - z^2): half turns about a splat's axes, which
//             exchange components, leave it as it is
//   opacity   256 o, o = 1 / (1 + exp(-x)) of the logit x, at most 255
// each rounded to the nearest. Splats with less than 2 / 256 are left out: nothing of them is
// seen, see EQ(splat-opacity).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/splats/splats.h"
#include "pipeline/page/value_codec.h"

namespace regrade {

inline constexpr double kPositionStep = 1.0 / 8192;  // of the box's half extent
inline constexpr double kLogScaleStep = 1.0 / 80;
inline constexpr double kRotationStep = 1.0 / 1024;  // large needles turn
inline constexpr int kOpacitySteps = 256, kLeastOpacity = 2;

// Position, scale, rotation, opacity.
inline constexpr int kSplatNumbers = 10;
using SplatNumbers = std::array<int16_t, kSplatNumbers>;

SplatNumbers NumbersOfSplat(const Splat<float>& splat, const GridFrame& box);
// Throws Error(kInput) for numbers that NumbersOfSplat does not make.
Splat<float> SplatOfNumbers(const SplatNumbers& numbers, const GridFrame& box);

// A page has two parts, each in the order of a Morton curve, where neighbours follow each other
// and are predicted from those before: first the `coarse` ones that contribute most, by opacity
// times the area of the two longest axes over the squared distance from the box, as a scene
// that stands for the whole one.
struct SplatOrder {
  std::vector<int64_t> splat;           // [N]: which it is in the geometry
  std::vector<EarlierRecords> earlier;  // [N]
  int64_t coarse = 0;
};

// Of the geometry that is encoded or decoded: it depends on splats' numbers alone.
SplatOrder OrderOfSplats(const Geometry& geometry);

// What OrderOfSplats has, of N splats.
std::vector<EarlierRecords> EarlierSplats(int64_t count, int64_t coarse);

}  // namespace regrade
