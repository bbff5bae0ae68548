#include "pipeline/run/vignette.h"

#include <charconv>

#include "kernels/base/error.h"

namespace regrade {

Vignette ParseVignette(const std::string& text) {
  if (text == "none") return {};
  Vignette vignette;
  const char* const end = text.data() + text.size();
  const auto a = std::from_chars(text.data(), end, vignette.a);
  bool good = a.ec == std::errc() && a.ptr != end && *a.ptr == ',';
  if (good) {
    const auto b = std::from_chars(a.ptr + 1, end, vignette.b);
    good = b.ec == std::errc() && b.ptr == end;
  }
  for (double s = 0; good && s <= 1; s += 1.0 / 64)
    good = vignette(s) >= 0.05 && vignette(s) <= 4;  // not of a value that is not finite
  if (!good)
    throw UsageError(
        "'" + text + "' is no vignette", "--vignette",
        "use none, or two numbers A,B with 1 + A r^2 + B r^4 between 0.05 and 4; edit is of "
        "`regrade retouch`");
  return vignette;
}

std::string VignetteText(const Vignette& vignette) {
  return vignette.a == 0 && vignette.b == 0 ? "none"
                                            : Format("%.6g,%.6g", vignette.a, vignette.b);
}

}  // namespace regrade
