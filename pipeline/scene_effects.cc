#include "pipeline/scene_effects.h"

#include <algorithm>
#include <cstdio>

#include "pipeline/scene_views.h"

namespace regrade {
namespace {

EffectReport Decide(const char* name, double value, double threshold, const char* evidence) {
  return {name, value > threshold, evidence, value, threshold};
}

std::string Short(const Figure& figure) {
  if (!figure.value) return figure.why;
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", *figure.value);
  return text;
}

}  // namespace

std::vector<EffectReport> EffectsOf(const Capture& capture, int sh_degree) {
  double shift = 0;
  for (const CaptureView& view : capture.views)
    shift = std::max(shift, view.camera.MaxCornerDistortion());
  return {
      Decide("distortion", shift, kDistortionThreshold,
             "largest shift of a picture's corner by the lens, over the cameras, in pixels"),
      Decide("view-dependence", sh_degree, 0, "spherical harmonics degree of the fit, as set")};
}

std::string EffectLine(const EffectReport& effect) {
  return effect.name + (effect.on ? " on: " : " off: ") + Short(effect.value) +
         (effect.on ? " > " : " <= ") + Short(effect.threshold) + " (" + effect.evidence + ")";
}

}  // namespace regrade
