#include "pipeline/fields/placed_splats.h"

#include <algorithm>
#include <cmath>

#include "kernels/splats/splat_field.h"

namespace regrade {

SplatMove::SplatMove(const Similarity& target_from_source)
    : move_(target_from_source),
      log_scale_(std::log(target_from_source.scale)),
      turn_(target_from_source.rotation) {}

void SplatMove::Apply(int basis, ColoredSplat* record) const {
  const Vec3d mean = move_ * record->splat.mean.Cast<double>();
  turn_.Apply(basis, record);
  record->splat.mean = mean.Cast<float>();
  Vec3f& scale = record->splat.log_scale;
  scale = (scale.Cast<double>() + Vec3d{log_scale_, log_scale_, log_scale_}).Cast<float>();
}

SplatMove ToWorld(const StoredField& stored) {
  const Similarity& s = stored.field_from_world;
  const Mat3d back = s.rotation.Transposed();
  return SplatMove({1 / s.scale, back, -(back * s.translation) / s.scale});
}

namespace {

void MoveAll(const SplatMove& move, Splats* splats) {
  const int64_t width = 3 * splats->basis;
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < splats->count(); ++i) {
    ColoredSplat record = SplatAt(splats->view(), i);
    move.Apply(splats->basis, &record);
    splats->Set(i, record.splat);
    std::copy_n(record.sh, width, splats->sh.data() + i * width);
  }
}

}  // namespace

void MoveSplats(const Similarity& target_from_source, Splats* splats) {
  MoveAll(SplatMove(target_from_source), splats);
}

Splats WorldSplats(const StoredField& stored) {
  const SplatsView<float> view = SplatsOf(stored.field);
  Splats splats(view.count, view.basis);
  for (int64_t i = 0; i < view.count; ++i) splats.Set(i, view[i]);
  std::copy_n(view.sh, splats.sh.size(), splats.sh.data());
  splats.background = view.background;
  MoveAll(ToWorld(stored), &splats);
  return splats;
}

Mat3d HalfTurnAboutX() {
  Mat3d turn;
  turn(1, 1) = turn(2, 2) = -1;
  return turn;
}

}  // namespace regrade
