#include "pipeline/run/paper_traits.h"

#include "pipeline/capture/scene_profile.h"
#include "reconstruct/scene/forward_facing.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {

PaperTraits TraitsOf(const Capture& capture) {
  return {ShowsThroughPhotos(capture),
          MeasureForwardFacing(WithParallax(capture, kLeastParallaxDeg)).on};
}

}  // namespace regrade
