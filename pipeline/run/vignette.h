// --vignette: how a picture darkens or brightens towards its corners.
#pragma once

#include <string>

namespace regrade {

// 1 + a r^2 + b r^4, r in half diagonals from the centre.
struct Vignette {
  double a = 0, b = 0;
  double operator()(double squared) const { return 1 + a * squared + b * squared * squared; }
};

// Of --vignette: "A,B", or "none" for a = b = 0. Throws Error(kUsage) for anything else, and
// for factors outside [0.05, 4].
Vignette ParseVignette(const std::string& text);
std::string VignetteText(const Vignette& vignette);

}  // namespace regrade
