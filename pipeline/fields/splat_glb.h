// Splats as a binary glTF file with the extension KHR_gaussian_splatting (Khronos, ratified).
//
// One mesh of points. Attributes of 32-bit floats: POSITION, and with the extension's prefix
// ROTATION (x y z w), SCALE (standard deviations), OPACITY (in [0, 1]) and SH_DEGREE_l_COEF_n
// (red, green and blue of harmonic n of degree l; signs as in EQ(sh-basis)); COLOR_0 in 8 bits
// for programs that show points. Colours are sRGB as displayed ("srgb_rec709_display"). A splat
// takes 48 bytes and 12 for each harmonic of three channels.
//
// A file has one scene: PlayCanvas' engine shows all scenes of a file at once, others only the
// first.
#pragma once

#include <string>

#include "kernels/splats/splats.h"

namespace regrade {

// `splats`: at least one, all usable, in the world of the cameras (right, down, front). They
// are turned to glTF's axes: right, up, and back. Throws Error(kUsage) for more than a file of
// 4 GB holds; Error(kResources).
void WriteSplatGlb(const std::string& path, Splats splats);

}  // namespace regrade
