#include "kernels/splats/splat_field.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

Buffer<float> ToBuffer(const std::vector<float>& values) {
  Buffer<float> buffer(std::ssize(values));
  std::ranges::copy(values, buffer.data());
  return buffer;
}

// Files in half precision are finer near 1 than on the lengths that a fit leaves.
Buffer<float> UnitQuaternions(const std::vector<float>& quaternion) {
  Buffer<float> unit = ToBuffer(quaternion);
  for (int64_t i = 0; i < unit.size(); i += 4) {
    double squared = 0;
    for (int a = 0; a < 4; ++a) squared += double{unit[i + a]} * double{unit[i + a]};
    const double length = std::sqrt(squared);
    if (!(length > 0)) continue;
    for (int a = 0; a < 4; ++a) unit[i + a] = static_cast<float>(double{unit[i + a]} / length);
  }
  return unit;
}

}  // namespace

SplatOptions SplatOptionsFor(float near_clip, const Vec3f& radius, double fit_pixel) {
  SplatOptions options;
  const double longest = std::max({radius.x, radius.y, radius.z});
  options.near_plane = std::max(0.5 * static_cast<double>(near_clip), 1e-3 * longest);
  options.fit_pixel = fit_pixel;
  return options;
}

SplatsView<float> SplatsWithoutColors(const SplatGeometry& splats) {
  REGRADE_CHECK(splats.on());
  SplatsView<float> view;
  view.mean = splats.mean.data();
  view.log_scale = splats.log_scale.data();
  view.quaternion = splats.quaternion.data();
  view.opacity_logit = splats.opacity_logit.data();
  view.count = splats.opacity_logit.size();
  view.basis = 0;
  return view;
}

SplatsView<float> SplatsOf(const RadianceField& field) {
  SplatsView<float> view = SplatsWithoutColors(field.geometry->splats);
  view.sh = field.appearance.sh.data();
  view.basis = field.appearance.basis;
  view.background = field.background;
  return view;
}

SplatOptions SplatOptionsOf(const RadianceField& field) {
  return SplatOptionsFor(field.near_clip, field.geometry->frame.radius,
                         double{field.geometry->splats.fit_pixel});
}

RadianceField FieldOfSplats(const Splats& splats, const GridFrame& frame, float near_clip,
                            float fit_pixel) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = frame;
  geometry->splats = {ToBuffer(splats.mean), ToBuffer(splats.log_scale),
                      UnitQuaternions(splats.quaternion), ToBuffer(splats.opacity_logit),
                      fit_pixel};
  RadianceField field;
  field.geometry = std::move(geometry);
  field.appearance.basis = splats.basis;
  field.appearance.sh = ToBuffer(splats.sh);
  field.background = splats.background;
  field.near_clip = near_clip;
  return field;
}

}  // namespace regrade
