// Colours of a known meaning, by an ICC profile or by code points, in linear light of sRGB's
// primaries.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"

namespace regrade {

// Both functions return the name of the colours that were converted ("Display P3"). It is empty
// where the image is sRGB already, within half a step of 8 bits, and was left unchanged, as
// where nothing is known of its colours. Otherwise values become linear light with the
// primaries and the white of sRGB, relative colorimetric, by Bradford's adaptation, and are not
// clamped: what sRGB does not hold is below 0 or above 1. Alpha, straight, is kept.

// By an ICC profile of class display, input, output or colour space, for RGB (3, 4 channels) or
// grey (1 channel). `problem` gets the reason why one cannot be applied, and the image is then
// unchanged.
std::string LinearizeByProfile(std::string_view icc, Image* image, std::string* problem);

// By code points of ITU-T H.273, as films and HEIF files have them. A camera's curve (BT.709
// and its relatives) counts as sRGB's, which is how screens show it. Of PQ and HLG 203 cd/m^2
// are white (BT.2408), which is 75 % of HLG's signal, on its screen of 1000 cd/m^2.
std::string LinearizeByCicp(int primaries, int transfer, Image* image);
bool IsSrgbLike(int primaries, int transfer);
std::string CicpName(int primaries, int transfer);

// By the chromaticities x, y of red, green, blue and white; the image is linear light. For
// those of sRGB it is left unchanged.
std::string LinearizeByPrimaries(const std::array<float, 8>& chromaticities, Image* image);

// The profile of Adobe RGB (1998), for photos that have only its mark.
std::string AdobeRgbProfile();

}  // namespace regrade
