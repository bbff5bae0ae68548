// --residual: what is fitted for each splat or voxel behind the network.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct ResidualChoice {
  std::string residual = "none";

  bool On() const { return residual != "none"; }
  // The folder of "layers:DIR", or empty.
  std::string Layers() const {
    return residual.starts_with("layers:") ? residual.substr(7) : std::string();
  }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("residual", residual,
         {.help = "what the network does not carry of the 2D method, as a colour that is added "
                  "at each splat or voxel: none; views fits it to the method's pictures of all "
                  "renders; "
                  "layers:DIR, as `regrade retouch` sets it, also to what single photos have "
                  "beyond the method: 16-bit pictures by the photos' names, mid-grey where "
                  "that is nothing",
          .reads = "layers:"});
  }
};

}  // namespace regrade
