// Colour lookup tables (LUTs) in .cube files, as photo and video editors write them.
#pragma once

#include <string>
#include <string_view>

#include "kernels/image/color_table.h"
#include "kernels/scene/image.h"
#include "pipeline/files/text.h"

namespace regrade {

// One of the two: a table over colours, or a curve for each channel. In sRGB values.
struct ColorLut {
  std::string title;
  ColorTable table;    // size 0: none
  ColorCurves curves;  // empty: none

  Vec3d operator()(const Vec3d& c) const { return table.size > 0 ? table(c) : curves(c); }
  // The steepest slope: how many times it magnifies differences of colours at most.
  double Slope() const { return table.size > 0 ? SteepestSlope(table) : SteepestSlope(curves); }
};

// A steeper LUT makes a step of an 8-bit photo a visible band: 8 of 255 steps, 3 % of the
// range. Curves of photographers stay below.
inline constexpr double kHarmlessSlope = 8;
// How steep it is, in a sentence for the user, and what comes of that.
std::string SlopeText(const ColorLut& lut);

inline constexpr int kMostTableSize = 129, kMostCurveSize = 65536;

// By its name alone: does it end with .cube, in any case?
inline bool IsCubeFile(const std::string& path) { return LowerExtension(path) == ".cube"; }
// Throws Error(kInput) for a look of another program, by its name (.xmp, .dtstyle, .3dl and
// others): how to make a .cube of it.
void RefuseOtherLooks(const std::string& path);

// The format of Adobe's specification 1.0, with LUT_3D_INPUT_RANGE and LUT_1D_INPUT_RANGE of
// DaVinci Resolve: TITLE, LUT_3D_SIZE (2 to kMostTableSize) or LUT_1D_SIZE (2 to
// kMostCurveSize), DOMAIN_MIN, DOMAIN_MAX, comments with #, then one colour a line, red
// fastest. Numbers are finite and between -100 and 100, each side of the domain is at least
// 1e-3 long, the number of colours is that of the size. Spaces and tabs
// separate them, a plus may stand before them, and lines end as on any system. Throws
// Error(kInput) with the line.
ColorLut ParseCube(std::string_view text, const std::string& path);
ColorLut ReadCubeFile(const std::string& path);

// A table over [0, 1]^3, with six decimals.
std::string CubeText(const ColorTable& table, const std::string& title);

// Shows a LUT: what it makes of hues (across) and of lightness (down), 360 x 240.
Image LutChart(const ColorLut& lut);

// The picture that stands for a style, in reports: the style picture itself, see
// ReadStylePicture, or the chart of a LUT.
Image StyleExample(const std::string& path, std::string* notice);

}  // namespace regrade
