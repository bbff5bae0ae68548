// --match: several style pictures as one style.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct MatchChoice {
  std::string match = "none";
  std::string network;

  bool On() const { return match != "none"; }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("match", match,
         {.help = "with several style pictures: none makes a style of each; regions makes one "
                  "of all, in which a region of the scene takes the picture that has a region "
                  "like it, by colour and height in the picture; where that is not clear, the "
                  "program says so and asks for masks",
          .choices = "none|regions"});
    bind("match-network", network,
         {.help = "an ONNX network (input \"image\", output \"feat\") whose features --match "
                  "regions compares, too",
          .runs = "*"});
  }
};

}  // namespace regrade
