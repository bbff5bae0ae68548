// Control sequences at the photos' places: what bounds the table of neighbouring views.
#pragma once

#include <functional>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"

namespace regrade {

// Frames with another camera than the photos are not compared with them.
struct ViewControls {
  const WorkingViews* views;
  bool one_map;        // one map of colours may be fitted to what is styled
  const Image* style;  // null: the style is no picture
  std::function<Image(int)> photo_2d;

  // Of the views `of`, whose frames are given; photos, and photos as the 2D method styled them,
  // are last. `views` and `photo_2d` are used when a frame is asked for.
  std::vector<NamedFrameSource> Of(const std::vector<int>& of, const FrameSource& unstyled,
                                   const FrameSource& views_2d, const FrameSource& styled,
                                   bool with_photos) const;
};

}  // namespace regrade
