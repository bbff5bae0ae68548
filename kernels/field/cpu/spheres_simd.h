// A ray through the background's layers and its adjoint, with many crossings computed at once;
// compiled once per instruction set inside rays_simd.h's namespace.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>

#include "kernels/field/background_spheres.h"
#include "kernels/field/cpu/opacity_simd.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/vector_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

inline Wide Magnitude(Wide v) { return v < Wide{} ? -v : v; }

// atan(a) for a in [0, 1], to 2e-7 (the polynomial of Cephes's atanf).
inline Wide ArcTangent(Wide a) {
  const WideInt steep = a > Fill(0.41421356f);
  const Wide x = steep ? (a - 1.0f) / (a + 1.0f) : a;
  const Wide z = x * x;
  const Wide sum = (((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z -
                    3.33329491539e-1f) *
                       z * x +
                   x;
  return steep ? sum + 0.785398163f : sum;
}

inline Wide ArcTangent2(Wide y, Wide x) {
  const Wide across = Magnitude(y), along = Magnitude(x);
  const Wide larger = across > along ? across : along;
  const Wide smaller = across > along ? along : across;
  const Wide tiny = Fill(1e-30f);
  const Wide eighth = ArcTangent(smaller / (larger > tiny ? larger : tiny));
  const Wide quarter = across > along ? 1.57079633f - eighth : eighth;
  const Wide half = x < Wide{} ? 3.14159265f - quarter : quarter;
  return y < Wide{} ? -half : half;
}

// Consecutive layers, one per lane.
struct alignas(64) LayerBlock {
  float weight[4][kWide];
  int32_t texel[4][kWide];  // of the map
  int32_t crossed[kWide];
  float depth[kWide];  // world units along the ray
};

// See EQ(sphere-crossing), and LocateTexel.
inline void CrossLayers(const SphereRay<float>& ray, int layers, int resolution, int first,
                        LayerBlock* block) {
  const Wide index = Ramp() + static_cast<float>(first);
  const Wide u = 1.0f - (index + 0.5f) / static_cast<float>(layers);
  const Wide squared = Dot(ray.nearest, ray.nearest) * u * u;
  const Wide below = 1.0f - squared;
  const Wide root = SquareRoot(below > Wide{} ? below : Wide{});
  const Wide ahead = root - ray.along * u;
  const WideInt crossed =
      (below > Wide{}) & (ahead > Wide{}) & (index < Fill(static_cast<float>(layers)));
  const Wide px = ray.nearest.x * u + ray.direction.x * root;
  const Wide py = ray.nearest.y * u + ray.direction.y * root;
  const Wide pz = ray.nearest.z * u + ray.direction.z * root;
  constexpr float kInversePi = 0.318309886f;
  const float size = static_cast<float>(resolution);
  const Wide x = size * (1.0f + ArcTangent2(px, pz) * kInversePi);
  const Wide y = size * (0.5f - ArcTangent2(py, SquareRoot(px * px + pz * pz)) * kInversePi);
  const auto within = [](Wide v, int top) {
    const WideInt whole = __builtin_convertvector(v > Wide{} ? v : Wide{}, WideInt);
    const WideInt last = WideInt{} + top;
    return whole < last ? whole : last;
  };
  const WideInt x0 = within(x, 2 * resolution - 1), y0 = within(y, resolution - 1);
  const Wide fx = x - __builtin_convertvector(x0, Wide);
  const Wide fy = y - __builtin_convertvector(y0, Wide);
  const WideInt x1 = x0 + 1 < 2 * resolution ? x0 + 1 : WideInt{};
  const WideInt y1 = y0 + 1 < resolution ? y0 + 1 : y0;
  const WideInt texels[4] = {x0 * resolution + y0, x0 * resolution + y1, x1 * resolution + y0,
                             x1 * resolution + y1};
  const Wide weights[4] = {(1.0f - fx) * (1.0f - fy), (1.0f - fx) * fy, fx * (1.0f - fy),
                           fx * fy};
  const Wide depth = ahead / u * ray.world_per_unit;
  std::memcpy(block->texel, texels, sizeof(texels));
  std::memcpy(block->weight, weights, sizeof(weights));
  std::memcpy(block->crossed, &crossed, sizeof(crossed));
  std::memcpy(block->depth, &depth, sizeof(depth));
}

// A layer that composites.
struct LayerSample {
  Quad raw;           // colour before the clamp at 0; the last lane is the depth
  int32_t corner[4];  // texels of the columns, -1 if empty
  float weight[4];
  float alpha, decay, slope;   // as in StepBlock
  float transmittance_before;  // of the box and nearer layers
};

struct MarchedSpheres {
  LayerSample samples[kMaxLayers];
  int num_samples = 0;
  float transmittance = 1;  // behind all layers
};

// Null if the field has no spheres.
inline std::unique_ptr<MarchedSpheres> MakeMarchedSpheres(const FastGrid& grid) {
  return grid.spheres.on() ? std::make_unique<MarchedSpheres>() : nullptr;
}

// Returns the sum of w max(raw, 0), and the sum of w depth in the last lane.
inline Quad ShadeSpheres(const FastGrid& grid, const Ray& world_ray, float stop,
                         float transmittance, MarchedSpheres* result) {
  const FastSpheres& spheres = grid.spheres;
  result->num_samples = 0;
  result->transmittance = transmittance;
  Quad sums{};
  if (transmittance < stop) return sums;
  const SphereRay<float> ray = ToSphereRay(grid.frame, world_ray);
  if (!(ray.world_per_unit > 0)) return sums;
  const int layers = spheres.layers;
  const float delta = ray.world_per_unit / static_cast<float>(layers);
  constexpr float kDensest = static_cast<float>(kMaxDensity);
  constexpr float kDeepest = static_cast<float>(kMaxOpticalDepth);
  LayerBlock block;
  for (int first = 0; first < layers; first += kWide) {
    CrossLayers(ray, layers, spheres.resolution, first, &block);
    int32_t corner[4][kWide];
    for (int k = 0; k < 4; ++k)
      for (int lane = 0; lane < kWide; ++lane) {
        const int32_t column = spheres.links[block.texel[k][lane]];
        const int32_t texel = column < 0 ? -1 : column * layers + first + lane;
        corner[k][lane] = block.crossed[lane] != 0 ? texel : -1;
        __builtin_prefetch(spheres.texels.data() + 4 * int64_t{std::max(corner[k][lane], 0)});
      }
    Quad value[kWide];
    Wide sigma{};
    for (int lane = 0; lane < kWide; ++lane) {
      value[lane] = Quad{};
      for (int k = 0; k < 4; ++k)
        if (corner[k][lane] >= 0)
          value[lane] +=
              block.weight[k][lane] * *reinterpret_cast<const Quad*>(
                                          spheres.texels.data() + 4 * int64_t{corner[k][lane]});
      sigma[lane] = value[lane][3];
    }
    const Wide seen = sigma > Wide{} ? sigma : Wide{};
    const Wide bounded = seen < Fill(kDensest) ? seen : Fill(kDensest);
    const Wide product = bounded * delta;
    const Extinction extinction =
        Extinguish(product < Fill(kDeepest) ? product : Fill(kDeepest));
    for (int lane = 0; lane < kWide; ++lane) {
      if (!(sigma[lane] > 0)) continue;
      LayerSample& sample = result->samples[result->num_samples++];
      sample.raw = 0.5f + static_cast<float>(kSh0) * value[lane];
      sample.raw[3] = block.depth[lane];
      for (int k = 0; k < 4; ++k) {
        sample.corner[k] = corner[k][lane];
        sample.weight[k] = block.weight[k][lane];
      }
      sample.alpha = extinction.alpha[lane];
      sample.decay = extinction.decay[lane];
      sample.slope = sigma[lane] < kDensest && sigma[lane] * delta < kDeepest ? delta : 0.0f;
      sample.transmittance_before = result->transmittance;
      const Quad color = sample.raw > Quad{} ? sample.raw : Quad{};
      sums += result->transmittance * sample.alpha * color;
      result->transmittance *= sample.decay;
      if (result->transmittance < stop) return sums;
    }
  }
  return sums;
}

// Adds dL/d(texel) of all layers for dL/dC = d_color, last to first; `behind` is c_bg on entry
// and the radiance behind the box on return. See EQ(composite-adjoint).
inline void ScatterSpheres(const MarchedSpheres& marched, const Vec3f& d_color, Quad* behind,
                           SphereArena* arena) {
  const Quad d_quad{d_color.x, d_color.y, d_color.z, 0};
  for (int i = marched.num_samples; i-- > 0;) {
    const LayerSample& s = marched.samples[i];
    const Quad color = s.raw > Quad{} ? s.raw : Quad{};
    const float d_sigma =
        s.slope * s.transmittance_before * s.decay * SumOf((color - *behind) * d_quad);
    *behind = color * s.alpha + *behind * s.decay;
    const float w = s.transmittance_before * s.alpha * static_cast<float>(kSh0);
    Quad d_texel = s.raw > Quad{} ? w * d_quad : Quad{};
    d_texel[3] = d_sigma;
    for (int k = 0; k < 4; ++k) {
      if (s.corner[k] < 0) continue;
      const int32_t slot = arena->SlotOf(s.corner[k]);
      *reinterpret_cast<Quad*>(arena->gradient.data() + 4 * int64_t{slot}) +=
          s.weight[k] * d_texel;
    }
  }
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
