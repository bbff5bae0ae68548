// The guided filter for colour pictures: a filtered picture with the edges of another.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

// q = a_R R + a_G G + a_B B + b at every pixel, for each of three output channels.
struct GuidedCoefficients {
  Image of_red, of_green, of_blue;  // what R, G and B of the guide are multiplied by
  Image offset;
};

// EQ(guided-filter), He, Sun and Tang 2013, sec. 3.6: in each window of (2 radius + 1)^2 pixels
//   a = (Sigma + eps 1)^-1 cov(I, p),  b = mean(p) - a . mean(I)
// fit the picture p by the guide I (its covariance Sigma); each pixel gets the mean of a and b
// over its windows. Pictures are reflected at their edges (the edge pixel repeated). Both have
// three channels and the same size; eps > 0, in units of squared values.
GuidedCoefficients FitGuided(const Image& guide, const Image& picture, int radius, double eps);

// q for a guide of any size: the coefficients are smooth, so they are enlarged (bilinear), not
// q itself, which takes its detail from the guide (He and Sun 2015).
Image ApplyGuided(const GuidedCoefficients& coefficients, const Image& guide);

}  // namespace regrade
