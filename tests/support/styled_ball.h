// A painted ball, views of it in synthetic styles, and random networks, for tests of LipRF.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "kernels/network/lipschitz_layer.h"
#include "kernels/scene/facing.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/base_map.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/lipschitz_regularizer.h"
#include "stylize/field/local_lipschitz.h"
#include "stylize/training/initial_network.h"
#include "stylize/training/style_rays.h"
#include "stylize/training/train_network.h"
#include "tests/support/pinhole.h"
#include "tests/support/threads.h"

namespace regrade::testing {

inline double Random(uint64_t stream, uint64_t counter) {  // uniform in [-1, 1)
  return 2 * RandomDouble(20231104, stream, counter) - 1;
}

// A ball painted in smooth colours, with some view dependence, in an N^3 grid.
inline RadianceField Ball(int n, int basis = 9) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = {n, n, n};
  geometry->links.Resize(geometry->frame.NumVertices());
  std::vector<float> density, sh;
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z) {
        int32_t& link = geometry->links[geometry->frame.Vertex(x, y, z)];
        link = -1;
        const Vec3f p = geometry->frame.WorldOf(
            {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
        const float radius = Norm(p);
        if (radius > 0.75f + 4.0f / static_cast<float>(n))
          continue;  // no sample at an empty corner
        link = static_cast<int32_t>(density.size());
        density.push_back(40 * (0.75f - radius));
        for (int c = 0; c < 3; ++c)
          for (int k = 0; k < basis; ++k)
            sh.push_back(k == 0
                             ? 1.5f * std::sin(3 * p.x + 2 * static_cast<float>(c)) *
                                   std::cos(4 * p.y - p.z + static_cast<float>(c))
                             : 0.1f * static_cast<float>(Random(50 + k, density.size() / 5)));
      }
  geometry->density.Resize(static_cast<int64_t>(density.size()));
  std::copy(density.begin(), density.end(), geometry->density.begin());
  RadianceField field;
  field.geometry = geometry;
  field.appearance.basis = basis;
  field.appearance.sh.Resize(static_cast<int64_t>(sh.size()));
  std::copy(sh.begin(), sh.end(), field.appearance.sh.begin());
  field.background = {0.2f, 0.3f, 0.1f};
  return field;
}

inline std::vector<Camera> Ring(int views, int size) {
  std::vector<Camera> cameras;
  for (int v = 0; v < views; ++v) {
    const double a = 2 * M_PI * v / views;
    const Vec3d center{2.2 * std::cos(a), 2.2 * std::sin(a), 0.4 * std::sin(2 * a)};
    const Vec3d forward = Normalized(-center);
    const Vec3d right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
    Camera camera = PinholeOf(size, size, 1.3 * size);
    camera.camera_from_world = Facing(center, forward, right);
    cameras.push_back(camera);
  }
  return cameras;
}

// Colours of a field along rays, computed from ray weights without the renderer.
inline std::vector<Vec3f> Render(const RadianceField& field, const std::vector<Ray>& rays) {
  const RayWeights weights = ComputeRayWeights(
      *field.geometry, {rays.data(), static_cast<int64_t>(rays.size())}, MarchOptions{}, 0);
  std::vector<Vec3f> colors;
  const int basis = field.appearance.basis, stride = 3 * basis;
  for (size_t r = 0; r < rays.size(); ++r) {
    float gamma[kMaxBasis], sh[3 * kMaxBasis];
    ShBasis(basis, rays[r].direction, gamma);
    Vec3f color = field.background * weights.transmittance[r];
    for (int64_t i = weights.first[r]; i < weights.first[r + 1]; ++i) {
      const WeightedSample& sample = weights.samples[static_cast<size_t>(i)];
      Interpolate(field.geometry->frame, field.geometry->links.data(),
                  field.appearance.sh.data(), stride, stride,
                  Cell<float>{sample.vertex, sample.fraction}, sh);
      for (int c = 0; c < 3; ++c) {
        float value = 0.5f;
        for (int k = 0; k < basis; ++k) value += sh[c * basis + k] * gamma[k];
        color[c] += sample.weight * std::max(value, 0.0f);
      }
    }
    colors.push_back(color);
  }
  return colors;
}

// Views of the ball with a style applied to each colour.
struct StyledBall {
  RadianceField field;
  std::vector<Image> targets, masks;  // a mask is 0 where the background is visible
  std::vector<StyledTrainingView> views;

  template <typename Style>
  StyledBall(int voxels, int num_views, int size, const Style& style) : field(Ball(voxels)) {
    const std::vector<Camera> cameras = Ring(num_views, size);
    targets.assign(cameras.size(), Image(size, size));
    masks.assign(cameras.size(), Image(size, size, 1));
    for (size_t v = 0; v < cameras.size(); ++v) {
      std::vector<Ray> rays;
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) rays.push_back(cameras[v].PixelRay(x, y));
      const std::vector<Vec3f> colors = Render(field, rays);
      for (size_t i = 0; i < rays.size(); ++i) {
        const Vec3f styled = style(colors[i]);
        std::copy_n(&styled.x, 3, &targets[v].pixels[i * 3]);
        const RayWeights weights =
            ComputeRayWeights(*field.geometry, {&rays[i], 1}, MarchOptions{}, 0);
        masks[v].pixels[i] = weights.transmittance[0] < 0.01f ? 1.0f : 0.0f;
      }
      views.push_back({cameras[v], &targets[v], &masks[v], "view " + std::to_string(v)});
    }
  }
};

inline Vec3f LinearStyle(const Vec3f& c) {
  return {0.1f + 0.7f * c.x + 0.1f * c.y, 0.8f * c.y + 0.05f, 0.2f + 0.5f * c.z + 0.1f * c.x};
}

inline Vec3f CurvedStyle(const Vec3f& c) {
  const float luma = 0.3f * c.x + 0.6f * c.y + 0.1f * c.z;
  const float s = 4 * (luma - 0.5f) * (luma - 0.5f);  // for shadows and highlights
  return {0.2f + 0.3f * c.x + 0.4f * s, 0.3f * c.y + 0.5f * s, 0.5f + 0.3f * c.z - 0.4f * s};
}

inline LipschitzNetwork RandomNetwork(uint64_t stream, double k = 1.3, int basis = 9) {
  LipschitzNetwork network(basis);
  for (size_t i = 0; i < network.data().parameters.size(); ++i)
    network.data().parameters[i] = static_cast<float>(0.3 * Random(stream, i));
  for (int l = 0; l < kNetworkLayers; ++l) network.k(l) = static_cast<float>(k);
  network.data().sh_scale = 1.4f;
  network.WarmUpNorms();
  return network;
}

inline ColorMap SomeMap() {
  ColorMap map;
  map.matrix.row[0] = {1.2, -0.1, 0.2};
  map.matrix.row[1] = {0.0, 0.8, 0.1};
  map.matrix.row[2] = {-0.3, 0.1, 0.9};
  map.offset = {0.05, -0.1, 0.1};
  return map;
}

inline StyleRays SomeRays(int views, int size) {
  StyleRays batch;
  batch.cameras = Ring(views, size);
  for (int32_t v = 0; v < views; ++v)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        batch.AddPixel(v, x, y);
        const uint64_t i = batch.rays.size();
        batch.targets.push_back({static_cast<float>(0.5 + 0.5 * Random(60, i)),
                                 static_cast<float>(0.5 + 0.5 * Random(61, i)),
                                 static_cast<float>(0.5 + 0.5 * Random(62, i))});
      }
  return batch;
}

// |a - b| / |b|
inline double RelativeDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, norm = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += b[i] * b[i];
  }
  return std::sqrt(difference / norm);
}

}  // namespace regrade::testing
