#include "kernels/splats/splats.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

[[noreturn]] void Refuse(const char* name, const std::string& defect) {
  throw InputError(defect, name, "the file is damaged or was not written by a splat program");
}

}  // namespace

void Validate(const Splats& splats, const char* name) {
  const int basis = splats.basis;
  if (!IsBasis(basis))
    Refuse(name, Concat(basis, " harmonics a channel; 1, 4, 9 or 16 are supported"));
  const size_t n = splats.opacity_logit.size();
  if (n > INT32_MAX) Refuse(name, Concat(n, " splats, at most ", INT32_MAX, " are supported"));
  if (splats.mean.size() != 3 * n || splats.log_scale.size() != 3 * n ||
      splats.quaternion.size() != 4 * n ||
      splats.sh.size() != 3 * n * static_cast<size_t>(basis))
    Refuse(name, "the sizes of the splats' arrays disagree");
  if (!AllFinite(splats.background)) Refuse(name, "the background is not finite");
  const SplatsView<float> view = splats.view();
  int64_t bad = 0, first = -1;
  for (int64_t i = 0; i < view.count; ++i)
    if (!IsUsable(view, i) && bad++ == 0) first = i;
  if (bad > 0)
    Refuse(name, Concat(bad, " splats of ", n,
                        " have values that are not finite or too large; the first is ", first));
}

}  // namespace regrade
