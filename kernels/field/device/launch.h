// How device kernels are launched: sizes, and the choice of a template by the field's basis.
#pragma once

#include <cstdint>
#include <type_traits>

#include "kernels/base/error.h"

namespace regrade {

inline constexpr int kThreads = 256;

inline unsigned BlocksFor(int64_t threads) {
  return static_cast<unsigned>((threads + kThreads - 1) / kThreads);
}

template <typename Launch>
void ByBasis(int basis, const Launch& launch) {
  if (basis == 9)
    launch(std::integral_constant<int, 9>());
  else if (basis == 4)
    launch(std::integral_constant<int, 4>());
  else if (basis == 1)
    launch(std::integral_constant<int, 1>());
  else
    REGRADE_CHECK(false);
}

}  // namespace regrade
