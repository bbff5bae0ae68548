#include "pipeline/run/paper_traits.h"

#include "pipeline/capture/scene_profile.h"
#include "reconstruct/scene/forward_facing.h"

namespace regrade {

PaperTraits TraitsOf(const Capture& capture) {
  return {ShowsThroughPhotos(capture), MeasureForwardFacing(capture).on};
}

}  // namespace regrade
