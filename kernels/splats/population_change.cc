#include "kernels/splats/population_change.h"

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {

void ApplyChange(const PopulationChange& change, bool moments, Splats* splats) {
  const int64_t sh = 3 * splats->basis;
  const auto resize = [&](std::vector<float>* values, int64_t each) {
    values->resize(static_cast<size_t>(each * change.count));
  };
  resize(&splats->mean, 3);
  resize(&splats->log_scale, 3);
  resize(&splats->quaternion, 4);
  resize(&splats->opacity_logit, 1);
  resize(&splats->sh, sh);
  const auto each = [&](const auto& edit) {
    edit(&splats->mean, 3), edit(&splats->log_scale, 3), edit(&splats->quaternion, 4);
    edit(&splats->opacity_logit, 1), edit(&splats->sh, sh);
  };
  for (const CopiedSplat& copied : change.copied) {
    const size_t i = static_cast<size_t>(copied.index);
    if (moments) {
      each([&](std::vector<float>* values, int64_t n) {
        std::fill_n(values->begin() + n * copied.index, n, 0.0f);
      });
      continue;
    }
    splats->opacity_logit[i] = copied.opacity_logit;
    for (size_t a = 0; a < 3; ++a) splats->log_scale[3 * i + a] += copied.log_factor;
  }
  for (const SplatCopy& copy : change.copies)
    each([&](std::vector<float>* values, int64_t n) {
      std::copy_n(values->begin() + n * copy.from, n, values->begin() + n * copy.to);
    });
}

void PadBasis(int basis, Splats* splats) {
  REGRADE_CHECK(basis >= splats->basis);
  std::vector<float> sh(static_cast<size_t>(3 * basis * splats->count()));
  for (int64_t row = 0; row < 3 * splats->count(); ++row)
    std::copy_n(splats->sh.begin() + row * splats->basis, splats->basis,
                sh.begin() + row * basis);
  splats->sh = std::move(sh);
  splats->basis = basis;
}

}  // namespace regrade
