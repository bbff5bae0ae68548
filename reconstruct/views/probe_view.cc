#include "reconstruct/views/probe_view.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/quantile.h"
#include "kernels/base/random.h"
#include "kernels/splats/splat_field.h"
#include "reconstruct/views/scene_extent.h"

namespace regrade {
namespace {

constexpr float kOpaque = 0.1f, kEmpty = 0.9f;  // transmittance below and above
constexpr double kJump = 0.2;                   // of depth, relative
constexpr double kSameDepth = 0.06;             // likewise, of a splat that is not hidden
constexpr double kFinest = 0.4, kCoarsest = 4;  // pixels of a picture of kWidth
constexpr double kWidth = 480;

float SeenAt(const Camera& camera, const Image& depths, const SampledSplat& sample) {
  double u = 0, v = 0, depth = 0;
  if (!camera.Project(sample.mean, &u, &v, &depth)) return 0;
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return 0;
  const double shown = *depths.at(static_cast<int>(u), static_cast<int>(v));
  if (!(shown > 0) || std::abs(depth - shown) > kSameDepth * shown) return 0;
  const double pixels = sample.size / depth * camera.fx * kWidth / camera.width;
  return static_cast<float>(std::min({1.0, pixels / kFinest, kCoarsest / pixels}));
}

}  // namespace

double ViewProbe::Quality() const {
  const double shown = 1 - empty;
  if (!(shown > 0)) return 0;
  return std::pow(opaque / shown, 2) * std::max(0.0, 1 - 1.5 * rough);
}

std::vector<SampledSplat> SampleSplats(const Splats& splats, int64_t most) {
  const SplatsView<float> view = splats.view();
  std::vector<SampledSplat> samples;
  for (const int64_t i : OpaqueSplats(view, most)) {
    const Splat<float> splat = view[i];
    samples.push_back({splat.mean.Cast<double>(), SizeOf(splat)});
  }
  return samples;
}

RadianceField FieldForProbes(const Splats& splats, const RadianceField& field, int64_t most) {
  const int64_t few = std::max<int64_t>(1, (splats.count() + most - 1) / most);
  const SplatsView<float> view = splats.view();
  const float larger = 0.5f * std::log(static_cast<float>(few));
  Splats some(splats.count() / few, 1);
  for (int64_t i = 0; i < some.count(); ++i) {
    const uint64_t drawn =
        RandomIndex(0, 0, static_cast<uint64_t>(i), static_cast<uint64_t>(few));
    Splat<float> splat = view[i * few + static_cast<int64_t>(drawn)];
    for (int a = 0; a < 3; ++a) splat.log_scale[a] += larger;
    some.Set(i, splat);
  }
  return FieldOfSplats(some, field.geometry->frame, field.near_clip,
                       field.geometry->splats.fit_pixel);
}

ViewProbe ProbeView(const FieldRenderer& renderer, const Camera& camera,
                    const std::vector<SampledSplat>& samples) {
  const RenderedView view = renderer.Render(camera);
  ViewProbe probe;
  std::vector<double> depths;
  int64_t opaque = 0, empty = 0, border = 0, border_empty = 0, pairs = 0, jumps = 0;
  const auto depth_at = [&](int x, int y) {
    return *view.transmittance.at(x, y) < kOpaque ? double{*view.depth.at(x, y)} : 0.0;
  };
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const bool nothing = *view.transmittance.at(x, y) > kEmpty;
      empty += nothing;
      if (x == 0 || y == 0 || x == camera.width - 1 || y == camera.height - 1)
        ++border, border_empty += nothing;
      const double depth = depth_at(x, y);
      if (!(depth > 0)) continue;
      ++opaque;
      depths.push_back(depth);
      for (const double other :
           {x > 0 ? depth_at(x - 1, y) : 0, y > 0 ? depth_at(x, y - 1) : 0})
        if (other > 0)
          ++pairs, jumps += std::abs(depth - other) > kJump * std::min(depth, other);
    }
  const auto pixels = static_cast<double>(view.color.num_pixels());
  probe.opaque = static_cast<double>(opaque) / pixels;
  probe.empty = static_cast<double>(empty) / pixels;
  probe.border =
      static_cast<double>(border_empty) / static_cast<double>(std::max<int64_t>(1, border));
  probe.rough = pairs > 0 ? static_cast<double>(jumps) / static_cast<double>(pairs) : 1;
  probe.nearest = Quantile(depths, 0.02);
  for (const SampledSplat& sample : samples)
    probe.seen.push_back(SeenAt(camera, view.depth, sample));
  return probe;
}

}  // namespace regrade
