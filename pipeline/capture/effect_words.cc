#include "pipeline/capture/effect_words.h"

#include <algorithm>
#include <iterator>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr const char* kNames[] = {"ndc",      "alpha",         "background",   "falloff",
                                  "exposure", kViewDependence, kPoseRefinement};

}  // namespace

std::map<std::string, bool> ParseEffects(const std::string& text) {
  std::map<std::string, bool> overrides;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    begin = end + 1;
    if (word == "auto") continue;
    const size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    const bool known = std::ranges::find(kNames, name) != std::end(kNames);
    if (!known || (value != "on" && value != "off"))
      throw UsageError(
          "'" + word + "' is not allowed", "--effects",
          "auto, or on|off of ndc, alpha, background, exposure, view-dependence and "
          "pose-refinement: ndc=on,exposure=off");
    overrides[name] = value == "on";
  }
  return overrides;
}

}  // namespace regrade
