// Options of `regrade refine`.
#pragma once

#include <string>

#include "kernels/base/options.h"
#include "pipeline/run/film_parts.h"

namespace regrade {

struct RefineOptions {
  int blocks = 8;
  std::string part;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("blocks", blocks,
         {.help = "parts of space that are fitted one after another, so that each fits into "
                  "memory; all processes that work on a field must be given the same",
          .min = 1,
          .max = 100000,
          .once = true});
    bind("part", part,
         {.help = "K/N makes each N-th block from the K-th on, in their turns, to blocks/ of "
                  "the folder, and nothing else; parts may be made at the same time, on any "
                  "machines that share the folder. join makes the field of blocks that are "
                  "there, and names those that are missing",
          .once = true});
  }
  bool Join() const { return part == kJoinParts; }
  bool One() const { return !part.empty() && !Join(); }
};

}  // namespace regrade
