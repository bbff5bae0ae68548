// A painted ball of splats, and views of it in synthetic styles, for tests of LipRF.
#pragma once

#include "kernels/render/field_renderer.h"
#include "kernels/splats/splat_field.h"
#include "tests/support/small_splats.h"
#include "tests/support/styled_ball.h"

namespace regrade::testing {

// Splats around a sphere of radius 0.7, opaque together, in smooth colours with some view
// dependence. `contrast` multiplies the colours' coefficients.
inline RadianceField SplatBall(int64_t count, float contrast = 1, int basis = 9) {
  Splats splats(count, basis);
  for (int64_t i = 0; i < count; ++i) {
    const uint64_t item = static_cast<uint64_t>(i);
    Vec3d at{Draw(71, item, 0, -1, 1), Draw(71, item, 1, -1, 1), Draw(71, item, 2, -1, 1)};
    at = Normalized(at + Vec3d{1e-3, 0, 0}) * Draw(71, item, 3, 0.6, 0.7);
    Splat<float> splat;
    splat.mean = at.Cast<float>();
    for (int a = 0; a < 3; ++a)
      splat.log_scale[a] =
          static_cast<float>(std::log(Draw(72, item, static_cast<uint64_t>(a), 0.03, 0.1)));
    for (int a = 0; a < 4; ++a)
      splat.quaternion[a] = static_cast<float>(Draw(73, item, static_cast<uint64_t>(a), -1, 1));
    splat.opacity_logit = static_cast<float>(Draw(74, item, 0, 1, 4));
    splats.Set(i, splat);
    const Vec3f p = splat.mean;
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < basis; ++k)
        splats.sh[static_cast<size_t>(3 * basis * i + basis * c + k)] =
            contrast *
            (k == 0
                 ? 1.5f * std::sin(3 * p.x + 2 * static_cast<float>(c)) *
                       std::cos(4 * p.y - p.z + static_cast<float>(c))
                 : 0.1f * static_cast<float>(Draw(
                              75, item, static_cast<uint64_t>((basis > 9 ? basis : 9) * c + k),
                              -1, 1)));
  }
  splats.background = {0.2f, 0.3f, 0.1f};
  return FieldOfSplats(splats, GridFrame{}, 0.2f, -1);
}

// Views of a ball of splats with a style applied to each colour.
struct StyledSplats {
  RadianceField field;
  std::vector<Image> photos, targets, masks;  // a mask is 0 where the background is visible
  std::vector<StyledTrainingView> views;

  template <typename Style>
  StyledSplats(int64_t splats, int num_views, int size, const Style& style, int basis = 9)
      : field(SplatBall(splats, 0.4f, basis)) {
    const std::vector<Camera> cameras = Ring(num_views, size);
    const FieldRenderer renderer(field, Backend::kCpu);
    masks.assign(cameras.size(), Image(size, size, 1));
    for (size_t v = 0; v < cameras.size(); ++v) {
      const RenderedView view = renderer.Render(cameras[v]);
      photos.push_back(view.color);
      targets.push_back(view.color);
      for (size_t i = 0; i < masks[v].pixels.size(); ++i) {
        const float* p = &view.color.pixels[3 * i];
        const Vec3f styled = style(Vec3f{p[0], p[1], p[2]});
        std::copy_n(&styled.x, 3, &targets[v].pixels[3 * i]);
        masks[v].pixels[i] = view.transmittance.pixels[i] < 0.01f ? 1.0f : 0.0f;
      }
    }
    for (size_t v = 0; v < cameras.size(); ++v)
      views.push_back({cameras[v], &targets[v], &masks[v], "view " + std::to_string(v)});
  }
};

// The least squares of its targets.
inline SceneColorMap MapOf(const StyledSplats& ball) {
  StyleRays all;
  for (size_t v = 0; v < ball.views.size(); ++v) {
    all.cameras.push_back(ball.views[v].camera);
    const Image& target = ball.targets[v];
    for (int y = 0; y < target.height; ++y)
      for (int x = 0; x < target.width; ++x) {
        const float* t = target.at(x, y);
        all.AddPixel(static_cast<int32_t>(v), x, y);
        all.targets.push_back({t[0], t[1], t[2]});
        if (*ball.masks[v].at(x, y) < 0.5f) all.targets.back().x = std::nanf("");
      }
  }
  SceneColorMap result;
  result.map = LeastSquaresMap(ball.field, all, {.max_transmittance = 0.5f});
  result.k_est = SpectralNorm(result.map.matrix);
  return result;
}

// Every pixel of some cameras.
inline ViewRays PixelsOf(const std::vector<Camera>& cameras) {
  ViewRays rays{.cameras = cameras};
  for (size_t c = 0; c < cameras.size(); ++c)
    for (int y = 0; y < cameras[c].height; ++y)
      for (int x = 0; x < cameras[c].width; ++x) rays.AddPixel(static_cast<int32_t>(c), x, y);
  return rays;
}

}  // namespace regrade::testing
