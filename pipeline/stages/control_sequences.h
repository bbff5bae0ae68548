// Sequences that bound a table of metrics: what no method should fall below, and what a metric
// alone would reward.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"

namespace regrade {

// Names of the rows, behind a prefix such as kPathPrefix.
inline constexpr char kLinearMapControl[] = "control_linear_map",
                      kBlurredControl[] = "control_blurred", kGreyControl[] = "control_grey";

struct ControlInputs {
  FrameSource unstyled, styled;
  FrameSource views_2d = {};     // the 2D method's version of each unstyled frame; may be empty
  const Image* style = nullptr;  // the style picture; may be null
  bool one_map = true;           // false: only a part of the scene is styled
};

// The unstyled frames under one linear colour map, clipped: BestLinearMap onto the 2D method's
// frames, or without these the Monge-Kantorovich map onto the style picture's colours; left out
// without either. The styled frames blurred, with a standard deviation of 1/160 of their longer
// side, and in grey, with the luma of Rec. 709. Frames have the size of the inputs' and are
// made when they are asked for; `unstyled` and `views_2d` are read before, for the map.
std::vector<NamedFrameSource> ControlSequences(const ControlInputs& inputs,
                                               const std::string& prefix = "");

// Why ControlSequences has no linear map; empty where it has one.
std::string WhyNoLinearMap(const ControlInputs& inputs);

// Of the photos' places. Frames with another camera than the photos are not compared with them.
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
