// How far the edges of one picture are from those of another: crops, turns, lens corrections
// and moved parts, whatever was done to the colours.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

struct EdgeShift {
  double pixels = 0;     // the largest shift of a part that both pictures show
  double x = 0, y = 0;   // the middle of that part, in pixels
  int parts = 0;         // parts with enough edges to compare
  double agreement = 0;  // median over the parts, of the height of the correlation's peak
};

// Edges are the magnitudes of gradients, and parts are squares of an eighth of the longer side,
// at least 48 pixels, each with the next by phase correlation (Kuglin and Hines 1975; to
// fractions of a pixel by the peak's centroid). Both pictures have the same size.
EdgeShift MeasureEdgeShift(const Image& a, const Image& b);

}  // namespace regrade
