// Paint for synthetic scenes: aperiodic patterns with corners at several scales, so that
// features can be matched between views.
#pragma once

#include <array>
#include <cstdint>

#include "kernels/base/vec.h"

namespace regrade {

enum class Pattern {
  kPlain,     // one colour
  kTerrazzo,  // polygonal chips of two sizes in a ground
  kTiles,     // square tiles, each with another motif
  kCloth,     // crossing bands of irregular widths
  kPainting,  // contours of a warped noise
  kDots,      // round spots on a glaze
  kPlanks,    // boards of different tones with grain
};

// Size of the smallest blobs, world units: a few pixels in the default captures.
inline constexpr double kFinestDetail = 0.026;

struct Paint {
  Pattern pattern = Pattern::kPlain;
  double size = 0.2;               // world units: a tile's, a large chip's, a board's width
  std::array<Vec3d, 5> palette{};  // linear RGB; the first is the ground
  uint64_t seed = 0;
  double detail = kFinestDetail;  // size of the mottle's smallest blobs, world units
};

// Linear RGB of an 0xRRGGBB sRGB colour.
Vec3d LinearFromHex(uint32_t hex);

// Reflectance in [0, 1], linear RGB, at surface coordinates (u, v) in world units. A mottle of
// a few per cent, down to the paint's `detail`, is added to the pattern for feature detectors.
Vec3d Albedo(const Paint& paint, double u, double v);

}  // namespace regrade
