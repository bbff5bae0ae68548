// How far an image moved, and how much of that a turning camera does not explain.
#pragma once

#include "evaluate/flow_field.h"

namespace regrade {

struct FlowMotion {
  double motion = 0;    // median length of the flow, pixels
  double parallax = 0;  // upper quartile of its distance from the best turn, pixels
};

// A camera that only turns and zooms, or one before a plane, moves the image by
//   u = a + b x + c y + g x^2 + h x y,   v = d + e x + f y + g x y + h y^2
// to first order (Longuet-Higgins and Prazdny 1980). The coefficients are fitted to the least
// sum of distances at points of a grid; what remains comes from different depths. Unknown flow
// is ignored; zeros where less than 16 points are known.
FlowMotion MeasureFlowMotion(const FlowField& flow);

}  // namespace regrade
