#include "pipeline/splat_files/placed_splats.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/splat_files/splat_record.h"

namespace regrade {

void MoveSplats(const Similarity& target_from_source, Splats* splats) {
  const SplatTurn turn(target_from_source.rotation);
  const auto log_scale = static_cast<float>(std::log(target_from_source.scale));
  const int64_t width = 3 * splats->basis;
  for (int64_t i = 0; i < splats->count(); ++i) {
    SplatRecord record{splats->view()[i], {}};
    float* const sh = splats->sh.data() + i * width;
    std::copy_n(sh, width, record.sh);
    const Vec3d mean = target_from_source * record.splat.mean.Cast<double>();
    turn.Apply(splats->basis, &record);
    record.splat.mean = mean.Cast<float>();
    for (int a = 0; a < 3; ++a) record.splat.log_scale[a] += log_scale;
    splats->Set(i, record.splat);
    std::copy_n(record.sh, width, sh);
  }
}

std::vector<float> ColorsBeforeMove(const Similarity& target_from_source,
                                    std::span<const float> sh, int basis) {
  const SplatTurn back(target_from_source.rotation.Transposed());
  const size_t width = 3 * static_cast<size_t>(basis);
  REGRADE_CHECK(sh.size() % width == 0);
  std::vector<float> before(sh.size());
  for (size_t i = 0; i < sh.size(); i += width) {
    SplatRecord record;
    std::copy_n(sh.begin() + static_cast<long>(i), width, record.sh);
    back.Apply(basis, &record);
    std::copy_n(record.sh, width, before.begin() + static_cast<long>(i));
  }
  return before;
}

}  // namespace regrade
