#include "pipeline/run/profile_run.h"

#include "pipeline/run/fit_kind.h"

namespace regrade {

SceneProfile ProfileRun(const RunSettings& settings, const Capture& capture,
                        const std::string& overrides) {
  return ProfileScene(capture, FitKindOf(settings).sh_degree(settings),
                      settings.run.effects + overrides, settings.scene.box,
                      settings.scene.Kind());
}

NormalizedScene SceneOfRun(const RunSettings& settings, const Capture& capture) {
  return ProfileRun(settings, capture, ",exposure=off").scene;
}

}  // namespace regrade
