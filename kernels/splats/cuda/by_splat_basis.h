// Selects a template instance by the basis of splats.
#pragma once

#include <type_traits>

#include "kernels/base/error.h"

namespace regrade {

template <typename Launch>
void BySplatBasis(int basis, const Launch& launch) {
  if (basis == 16)
    launch(std::integral_constant<int, 16>());
  else if (basis == 9)
    launch(std::integral_constant<int, 9>());
  else if (basis == 4)
    launch(std::integral_constant<int, 4>());
  else if (basis == 1)
    launch(std::integral_constant<int, 1>());
  else
    REGRADE_CHECK(false);
}

}  // namespace regrade
