// 2D methods that move the whole distribution of colours onto the style's, not only its
// moments: iterative distribution transfer and histogram matching.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/base/vec.h"
#include "stylize/image/style_options.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// A monotone, piecewise linear map of numbers. `from` is strictly ascending, `to` ascending;
// beyond its ends the map goes on with slope 1.
struct MonotoneMap {
  std::vector<double> from, to;
  double operator()(double x) const;
};

// EQ(histogram-matching): t = F_style^-1 o F_source, from kQuantiles mid-quantiles of both
// sorted samples. Source quantiles within half a rounding step of each other count as one
// colour, which takes the mean of what they would: a constant channel takes the style's, and
// noise below 8 bits is never blown up to the style's spread.
MonotoneMap MatchHistograms(const std::vector<double>& sorted_source,
                            const std::vector<double>& sorted_style);

// EQ(idt), Pitie, Kokaram and Dahyot 2007: c <- c + R^T (t(R c) - R c), iterated, R a rotation
// and t the histogram matching of each of its axes between what the source has become and the
// style. The first R is the identity; the others are uniform rotations, drawn from a counter,
// so every view and every run has the same ones. The rotations are kept with their maps: the
// result is a map of colours, that can be learned from a sample and applied anywhere. Where the
// map is steep, the photo's noise becomes louder; EQ(regrain) takes it back where it is asked
// for.
struct DistributionMap {
  struct Turn {
    Mat3d rotation;
    std::array<MonotoneMap, 3> axes;
  };
  std::vector<Turn> turns;
  Vec3d operator()(Vec3d color) const;
};
// What the turns need of a style: quantiles along each turn's axes, the same for all views.
struct StyleTurns {
  std::vector<std::array<std::vector<double>, 3>> quantiles;
};
StyleTurns MeasureTurns(const std::vector<Vec3d>& style, int iterations);
DistributionMap LearnDistributionMap(std::vector<Vec3d> source, const StyleTurns& style);

// At most kColorSample colours, evenly strided over the pixels that are finite and not
// transparent. Error(kInput) naming `where` if there is none. `heights`, where it is given,
// gets the height of each of them in the picture, from 0 at the bottom to 1 at the top.
inline constexpr int64_t kColorSample = 1 << 16;
std::vector<Vec3d> SampleColors(const Image& image, const std::string& where,
                                int64_t most = kColorSample,
                                std::vector<double>* heights = nullptr);

// Methods idt and histogram (which is one iteration). `scene`, colours of all views, is needed
// for scene_wide only.
std::unique_ptr<ViewStylizer> MakeDistributionTransfer(
    const StyleOptions& options, const Image& style, const std::vector<Vec3d>* scene = nullptr);

}  // namespace regrade
