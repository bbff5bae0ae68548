#include "pipeline/run/profile_run.h"

namespace regrade {

SceneProfile ProfileRun(const RunSettings& settings, const Capture& capture,
                        const std::string& overrides) {
  return ProfileScene(capture, settings.sh_degree(), settings.run.effects + overrides,
                      settings.scene.box, settings.scene.UsesSplats());
}

NormalizedScene SceneOfRun(const RunSettings& settings, const Capture& capture) {
  return ProfileRun(settings, capture, ",exposure=off").scene;
}

}  // namespace regrade
