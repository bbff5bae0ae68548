#include "reconstruct/splats/relocation.h"

#include <cmath>

#include "kernels/base/error.h"

namespace regrade {

SplatCopies CopiesOf(double opacity, int copies) {
  REGRADE_CHECK(opacity > 0 && opacity < 1 && copies >= 1 && copies <= kMostCopies);
  const double each = -std::expm1(std::log1p(-opacity) / copies);
  double sum = 0, binomial = 1, power = 1;  // C(n, k + 1) and o'^(k + 1), signs apart
  for (int k = 0; k < copies; ++k) {
    binomial *= static_cast<double>(copies - k) / (k + 1);
    power *= each;
    sum += (k % 2 == 0 ? binomial : -binomial) * power / std::sqrt(k + 1.0);
  }
  return {each, std::log(opacity / sum)};
}

}  // namespace regrade
