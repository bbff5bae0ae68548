#include "pipeline/fields/placed_splats.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/fields/colored_splat.h"

namespace regrade {

void MoveSplats(const Similarity& target_from_source, Splats* splats) {
  const SplatTurn turn(target_from_source.rotation);
  const double log_scale = std::log(target_from_source.scale);
  const int64_t width = 3 * splats->basis;
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < splats->count(); ++i) {
    ColoredSplat record = SplatAt(splats->view(), i);
    const Vec3d mean = target_from_source * record.splat.mean.Cast<double>();
    turn.Apply(splats->basis, &record);
    record.splat.mean = mean.Cast<float>();
    Vec3f& scale = record.splat.log_scale;
    scale = (scale.Cast<double>() + Vec3d{log_scale, log_scale, log_scale}).Cast<float>();
    splats->Set(i, record.splat);
    std::copy_n(record.sh, width, splats->sh.data() + i * width);
  }
}

Splats WorldSplats(const StoredField& stored) {
  const SplatsView<float> view = SplatsOf(stored.field);
  Splats splats(view.count, view.basis);
  for (int64_t i = 0; i < view.count; ++i) splats.Set(i, view[i]);
  std::copy_n(view.sh, splats.sh.size(), splats.sh.data());
  splats.background = view.background;
  const Similarity& s = stored.field_from_world;
  const Mat3d back = s.rotation.Transposed();
  MoveSplats({1 / s.scale, back, -(back * s.translation) / s.scale}, &splats);
  return splats;
}

Mat3d HalfTurnAboutX() {
  Mat3d turn;
  turn(1, 1) = turn(2, 2) = -1;
  return turn;
}

std::vector<float> ColorsBeforeMove(const Similarity& target_from_source,
                                    std::span<const float> sh, int basis) {
  const SplatTurn back(target_from_source.rotation.Transposed());
  const size_t width = 3 * static_cast<size_t>(basis);
  REGRADE_CHECK(sh.size() % width == 0);
  std::vector<float> before(sh.size());
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < sh.size(); i += width) {
    ColoredSplat record;
    std::copy_n(sh.begin() + static_cast<long>(i), width, record.sh);
    back.Apply(basis, &record);
    std::copy_n(record.sh, width, before.begin() + static_cast<long>(i));
  }
  return before;
}

}  // namespace regrade
