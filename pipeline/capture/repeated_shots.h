// Which photos of a folder show one shot twice, and which are exposures of one bracket.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// What tells a photo's shot.
struct ShotLook {
  std::string file;  // the user's name
  int width = 0, height = 0, bits = 8;
  std::string taken;  // EXIF's time, "2024:05:01 10:20:30.125"; empty where unknown
  double light = 0;   // exposure time x sensitivity / f-number^2; 0 where unknown
  Image small;        // [kLookSide, kLookSide, 3], sRGB
};
inline constexpr int kLookSide = 32;

// The photo as `small`.
Image LookOf(const Image& rgb);

struct LeftShot {
  std::string as;   // what it counts as, "second file of a shot"; empty: it is taken
  std::string why;  // "the same shot as IMG_1.HEIC"
};

// For each photo, in natural order of names. Two photos of one aspect are one shot if their
// names differ in the extension only and they look alike, as an export in another colour
// rendering does, or if they were taken at the same time and look the same. Taken is the one
// with more bits, else with more pixels, else the first. Photos that follow each other within
// kBracketSeconds, with exposures that differ by half a stop or more and the same framing, are
// a bracket: its middle exposure is taken, of an even number the darker middle one.
std::vector<LeftShot> RepeatedShots(const std::vector<ShotLook>& photos);
inline constexpr double kBracketSeconds = 3;

}  // namespace regrade
