// Renders the error of one pair of frames as an image.
#pragma once

#include <string>

#include "evaluate/consistency.h"

namespace regrade {

// Ends of the colour scale, from white through yellow and red to dark red, in dB of a pixel's
// error.
inline constexpr double kHeatWhiteDb = 50, kHeatDarkDb = 10;

// RGB, on the pixels of frame `at`; `motion` leads from them into `warped`. Trusted pixels show
// their squared error averaged over channels (the e of EQ(tc-psnr) for one pixel): white at 50
// dB and above, dark red at 10 dB and below, linear in dB between. Pixels of weight below 1/2,
// or with a non-finite colour, show `at` in grey at a quarter of its brightness. The scale is
// fixed, so maps of two methods are comparable.
Image ErrorHeatMap(const Image& at, const Image& warped, const PairMotion& motion);

// "NAME_gap1_00012.png" for the pair whose first frame is 12.
std::string HeatMapFileName(const PairResult& pair);

}  // namespace regrade
