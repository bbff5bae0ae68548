// Selects a device kernel's template instance by the field's basis, and by a flag.
#pragma once

#include <type_traits>

#include "kernels/base/error.h"
#include "kernels/device/launch_size.h"

namespace regrade {

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

template <typename Launch>
void ByBasis(int basis, bool flag, const Launch& launch) {
  ByBasis(basis, [&](auto constant) {
    if (flag)
      launch(constant, std::true_type());
    else
      launch(constant, std::false_type());
  });
}

}  // namespace regrade
