// Options of the modelled box, for what is not measured.
#pragma once

#include "kernels/base/options.h"

namespace regrade {

struct BoxOptions {
  float camera_range = 0;
  float margin = 0;
  float near_clip = -1;
  float background = -1;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("scene-camera-range", camera_range,
         {.unit = "half sides",
          .help = "the box is the cube around the optical axes' common point in which the "
                  "cameras have this median distance from the middle; 0: measured. Not of "
                  "forward-facing captures",
          .min = 0,
          .max = 100,
          .constant = true});
    bind("scene-margin", margin,
         {.unit = "fraction of the photos' longer side",
          .help =
              "the box of a forward-facing capture reaches this far beyond the mean camera's "
              "picture; 0: as far as all photos",
          .min = 0,
          .max = 2,
          .constant = true});
    bind("scene-near-clip", near_clip,
         {.unit = "half sides",
          .help = "nothing in the box is modelled nearer to a camera; below 0: measured",
          .min = -1,
          .max = 10,
          .constant = true});
    bind("scene-background", background,
         {.help = "grey behind everything; below 0: the photos' mean colour, or white behind "
                  "transparent photos",
          .min = -1,
          .max = 1,
          .constant = true});
  }
};

}  // namespace regrade
