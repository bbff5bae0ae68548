// COLMAP's camera models, and the mapping of their parameters to ours.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/scene/camera.h"

namespace regrade {

// COLMAP's camera models by their number in the file (colmap/src/colmap/sensor/models.h).
enum class ColmapLens : int32_t {
  kSimplePinhole = 0,
  kPinhole = 1,
  kSimpleRadial = 2,
  kRadial = 3,
  kOpenCv = 4,
  kOpenCvFisheye = 5,
  kFullOpenCv = 6,
  kFov = 7,  // not supported
  kSimpleRadialFisheye = 8,
  kRadialFisheye = 9,
  kThinPrismFisheye = 10,  // not supported
};

inline constexpr int kNumColmapLenses = 11;

// The file has the focal lengths (one or two), then the centre, then the distortion
// coefficients: the first `coefficients` of ours in the same order.
struct ColmapLensInfo {
  const char* name;
  int focals;  // 1 or 2; 0: not supported
  LensModel lens;
  int coefficients;
};

const ColmapLensInfo& InfoOf(ColmapLens lens);

// The model with the parameters of ours, and two focal lengths.
ColmapLens ColmapLensOf(LensModel lens);

// For a camera model that is not among them. Throws Error(kInput): the model is of a newer
// COLMAP.
[[noreturn]] void RefuseNewerLens(const std::string& what, const std::string& where);

inline const char* ColmapLensName(ColmapLens lens) { return InfoOf(lens).name; }

}  // namespace regrade
