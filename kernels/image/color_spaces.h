// Conversions between sRGB, linear light, CIE XYZ and CIELAB (D65), in double.
#pragma once

#include "kernels/base/vec.h"

namespace regrade {

// Encoded sRGB <-> linear light, channel by channel (IEC 61966-2-1). Values outside [0, 1] are
// allowed: below 0 the curve is continued as an odd function, so both directions are
// invertible.
Vec3d LinearFromSrgb(const Vec3d& srgb);
Vec3d SrgbFromLinear(const Vec3d& linear);

// Linear sRGB light <-> XYZ, white (1, 1, 1) at Y = 1.
Vec3d XyzFromLinear(const Vec3d& linear);
Vec3d LinearFromXyz(const Vec3d& xyz);

// EQ(cielab), CIE 15:2004, from encoded sRGB: L = 116 f(Y) - 16, a = 500 (f(X) - f(Y)),
// b = 200 (f(Y) - f(Z)), each of X, Y, Z divided by white's, and f the cube root with a linear
// toe. Grey has a = b = 0 up to rounding, white has L = 100.
Vec3d LabFromSrgb(const Vec3d& srgb);
Vec3d LabFromLinear(const Vec3d& linear);
Vec3d SrgbFromLab(const Vec3d& lab);

}  // namespace regrade
