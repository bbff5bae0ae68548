#include "kernels/splats/render_picture.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/splats/compositing.h"

namespace regrade {
namespace {

// Calls add(splat, hit, transmittance before it) for what a pixel sees, front to back.
template <typename T, typename Add>
PixelState<T> RenderPixel(const std::vector<SeenSplat<T>>& seen, int x, int y, const Add& add) {
  PixelState<T> state;
  SplatHit<T> hit;
  for (size_t i = 0; i < seen.size(); ++i) {
    const SeenSplat<T>& splat = seen[i];
    if (!HitSplat(splat.ellipse, splat.log_opacity, splat.reach, x, y, &hit)) continue;
    const T transmittance = state.transmittance;
    if (!CompositeSplat(hit.alpha, splat.color, splat.z, &state)) break;
    add(i, hit, transmittance);
  }
  return state;
}

template <typename T>
void AddPixel(const std::vector<SeenSplat<T>>& seen, const Vec3<T>& background,
              const SplatPicture<T>& d_picture, int x, int y,
              std::vector<SplatSums<double>>* sums, Vec3d* d_background) {
  struct Kept {
    size_t splat;
    SplatHit<T> hit;
    T transmittance;
  };
  std::vector<Kept> kept;
  const PixelState<T> state =
      RenderPixel(seen, x, y, [&](size_t i, const SplatHit<T>& hit, T t) {
        kept.push_back({i, hit, t});
      });
  const size_t at = static_cast<size_t>(y) * d_picture.width + x;
  PixelAdjoint<T> adjoint;
  for (int c = 0; c < 3; ++c) adjoint.d_color[c] = d_picture.color[3 * at + c];
  adjoint.d_depth = d_picture.depth[at];
  adjoint.d_transmittance = d_picture.transmittance[at];
  adjoint.color_behind = background;
  *d_background += (adjoint.d_color * state.transmittance).template Cast<double>();
  for (size_t k = kept.size(); k-- > 0;) {
    const SeenSplat<T>& splat = seen[kept[k].splat];
    const SplatHit<T>& hit = kept[k].hit;
    const T weight = kept[k].transmittance * hit.alpha;
    const T g = adjoint.Step(hit, kept[k].transmittance, splat.color, splat.z);
    SplatSums<double>& sum = (*sums)[kept[k].splat];
    sum.color += (adjoint.d_color * weight).template Cast<double>();
    sum.z += weight * adjoint.d_depth;
    sum.ellipse.f += g;
    for (int a = 0; a < 2; ++a) sum.ellipse.h[a] += g * hit.w[a];
    sum.ellipse.H[0] += g * hit.w[0] * hit.w[0];
    sum.ellipse.H[1] += g * hit.w[0] * hit.w[1];
    sum.ellipse.H[2] += g * hit.w[1] * hit.w[1];
  }
}

}  // namespace

template <typename T>
std::vector<SeenSplat<T>> SeeSplats(const SplatsView<T>& splats, const Camera& camera,
                                    const SplatOptions& options) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole && !camera.ndc.on());
  REGRADE_CHECK(options.near_plane > 0 && options.blur > 0);
  const SplatCamera own(camera);
  std::vector<SeenSplat<T>> seen;
  for (int64_t i = 0; i < splats.count; ++i) {
    SeenSplat<T> splat;
    if (SeeSplat(own, options, splats, i, &splat)) seen.push_back(splat);
  }
  std::stable_sort(seen.begin(), seen.end(), [](const SeenSplat<T>& a, const SeenSplat<T>& b) {
    return static_cast<float>(a.z) < static_cast<float>(b.z);
  });
  return seen;
}

template <typename T>
SplatPicture<T> RenderSplatsPlain(const SplatsView<T>& splats, const Camera& camera,
                                  const SplatOptions& options) {
  const std::vector<SeenSplat<T>> seen = SeeSplats(splats, camera, options);
  SplatPicture<T> picture(camera.width, camera.height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const PixelState<T> state = RenderPixel(seen, x, y, [](size_t, const SplatHit<T>&, T) {});
      const size_t at = static_cast<size_t>(y) * picture.width + x;
      const Vec3<T> color = state.color + splats.background * state.transmittance;
      for (int c = 0; c < 3; ++c) picture.color[3 * at + c] = color[c];
      picture.depth[at] = state.depth;
      picture.median_depth[at] = state.median_depth;
      picture.transmittance[at] = state.transmittance;
    }
  return picture;
}

template <typename T>
SplatArrays<T> RenderSplatsPlainAdjoint(const SplatsView<T>& splats, const Camera& camera,
                                        const SplatOptions& options,
                                        const SplatPicture<T>& d_picture) {
  REGRADE_CHECK(d_picture.width == camera.width && d_picture.height == camera.height);
  const std::vector<SeenSplat<T>> seen = SeeSplats(splats, camera, options);
  std::vector<SplatSums<double>> sums(seen.size());
  Vec3d d_background;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      AddPixel(seen, splats.background, d_picture, x, y, &sums, &d_background);
  SplatArrays<T> gradient(splats.count, splats.basis);
  gradient.background = d_background.template Cast<T>();
  const SplatCamera own(camera);
  for (size_t k = 0; k < seen.size(); ++k) {
    const int64_t i = seen[k].index;
    Splat<T> d;
    SeeSplatAdjoint(own, options, splats, seen[k], sums[k], &d,
                    &gradient.sh[3 * splats.basis * i]);
    gradient.Set(i, d);
  }
  return gradient;
}

template <typename T>
std::vector<SplatWeight<T>> WeightsOfPixel(const std::vector<SeenSplat<T>>& seen, int x,
                                           int y) {
  std::vector<SplatWeight<T>> weights;
  RenderPixel(seen, x, y, [&](size_t i, const SplatHit<T>& hit, T transmittance) {
    weights.push_back({seen[i].index, transmittance * hit.alpha});
  });
  return weights;
}

#define REGRADE_FOR(T)                                                                       \
  template std::vector<SeenSplat<T>> SeeSplats(const SplatsView<T>&, const Camera&,          \
                                               const SplatOptions&);                         \
  template SplatPicture<T> RenderSplatsPlain(const SplatsView<T>&, const Camera&,            \
                                             const SplatOptions&);                           \
  template SplatArrays<T> RenderSplatsPlainAdjoint(                                          \
      const SplatsView<T>&, const Camera&, const SplatOptions&, const SplatPicture<T>&);     \
  template std::vector<SplatWeight<T>> WeightsOfPixel(const std::vector<SeenSplat<T>>&, int, \
                                                      int);
REGRADE_FOR(float)
REGRADE_FOR(double)
#undef REGRADE_FOR

}  // namespace regrade
