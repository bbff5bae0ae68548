// The error of one pair of frames as a picture: where in the frame it comes from.
#pragma once

#include <string>
#include <utility>

#include "evaluate/consistency.h"

namespace regrade {

// Colours of the map, white to black red through yellow and red, in dB of a pixel's error.
inline constexpr double kHeatWhiteDb = 50, kHeatDarkDb = 10;

// RGB, sized as the earlier frame. Trusted pixels show their squared error averaged over
// channels (the e of EQ(tc-psnr) for one pixel): white at 50 dB and better, dark red at 10 dB
// and worse, even steps of dB between. Pixels of weight below 1/2, or with a colour that is not
// finite, show the earlier frame in grey at a quarter of its brightness. The scale is fixed, so
// maps of two methods may be laid side by side.
Image ErrorHeatMap(const Image& earlier, const Image& later, const PairMotion& motion);

// The pair of one sequence and gap with the largest error; null if no pair has one.
const PairResult* WorstPair(const std::string& sequence, int gap,
                            const std::vector<PairResult>& pairs);

// "NAME_gap1_00012.png" for the pair that begins with frame 12.
std::string HeatMapFileName(const PairResult& pair);

}  // namespace regrade
