// Edges of a picture as a map from 0 to 1, and how similar two pictures' edges are.
#pragma once

#include <functional>

#include "kernels/scene/image.h"

namespace regrade {

// EQ(gradient-edges): e = g^2 / (g^2 + m), g the length of the gradient (forward differences of
// the channel mean, 0 beyond the last row and column) and m the mean of g^2 over the picture:
// contrast and brightness do not change it. One channel, the picture's size; 0 everywhere
// without edges; NaN where a difference is not finite.
Image GradientEdges(const Image& picture);

// One channel of a picture's size, from 0 to 1.
using EdgeMapFunction = std::function<Image(const Image&)>;

inline constexpr char kGradientEdges[] = "gradient";

}  // namespace regrade
