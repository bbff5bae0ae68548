// --depth-network: depths that a network guesses from single photos.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct DepthChoice {
  std::string network;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("depth-network", network,
         {.help = "an ONNX network that guesses depth or inverse depth from a photo, such as "
                  "Depth Anything's: where a photo has no points of COLMAP's, splats start at "
                  "its guesses and are held near them"});
  }
};

}  // namespace regrade
