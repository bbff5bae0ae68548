// Body of the fast path, compiled once per instruction set: define REGRADE_SIMD_NAMESPACE
// before including it. It uses GCC's vector types nearly everywhere, so the same source
// compiles to SSE, AVX2 or AVX-512.
#include <algorithm>
#include <type_traits>

#include "kernels/field/cpu/march_simd.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/scatter_simd.h"
#include "kernels/field/cpu/shade_simd.h"
#include "kernels/field/cpu/spheres_simd.h"
#include "kernels/field/cpu/step_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Calls done(index, &marched) for each ray in order.
template <typename Done>
void MarchRays(const FastGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
               const Done& done) {
  Marched marched;
  for (int64_t r = 0; r < n; ++r) {
    March(grid, rays[r], options, &marched);
    done(r, &marched);
  }
}

// The colour of a ray that has been marched, with what is behind the box.
struct ShadedRay {
  Quad sums;  // the last lane: the sum of w t, in world units
  float transmittance;
};

template <int kBasis>
ShadedRay ShadeRay(const FastGrid& grid, const Ray& ray, const MarchOptions& options,
                   Marched* marched, MarchedSpheres* spheres) {
  Quad sums = Shade(grid, RayBasis<kBasis>(ray.direction), marched);
  sums[3] *= marched->world_per_voxel;
  float remaining = marched->transmittance;
  if (spheres != nullptr) {
    sums += ShadeSpheres(grid, ray, options.stop_transmittance, remaining, spheres);
    remaining = spheres->transmittance;
  }
  for (int a = 0; a < 3; ++a) sums[a] += grid.background[a] * remaining;
  return {sums, remaining};
}

template <int kBasis>
void RenderRays(const FastGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                float* color, float* depth, float* transmittance) {
  const auto spheres = MakeMarchedSpheres(grid);
  MarchRays(grid, rays, n, options, [&](int64_t r, Marched* marched) {
    const ShadedRay shaded = ShadeRay<kBasis>(grid, rays[r], options, marched, spheres.get());
    for (int a = 0; a < 3; ++a) color[3 * r + a] = shaded.sums[a];
    depth[r] = shaded.sums[3];
    transmittance[r] = shaded.transmittance;
  });
}

template <int kBasis, int kOther>
void RenderPair(const FastGrid& grid, const FastGrid& other, const Ray* rays, int64_t n,
                const MarchOptions& options, float* color, float* other_color, float* depth,
                float* transmittance) {
  const auto spheres = MakeMarchedSpheres(grid);
  MarchRays(grid, rays, n, options, [&](int64_t r, Marched* marched) {
    const ShadedRay first = ShadeRay<kBasis>(grid, rays[r], options, marched, spheres.get());
    const ShadedRay second = ShadeRay<kOther>(other, rays[r], options, marched, spheres.get());
    for (int a = 0; a < 3; ++a) {
      color[3 * r + a] = first.sums[a];
      other_color[3 * r + a] = second.sums[a];
    }
    depth[r] = first.sums[3];
    transmittance[r] = first.transmittance;
  });
}

template <int kBasis>
FitStepResult Accumulate(const FastGrid& grid, const RayBatch& batch,
                         const MarchOptions& options, float scale, GradientArena* arena) {
  FitStepResult result;
  const auto spheres = MakeMarchedSpheres(grid);
  MarchRays(grid, batch.rays, batch.size, options, [&](int64_t r, Marched* marched) {
    const RayBasis<kBasis> basis(batch.rays[r].direction);
    Quad sums = Shade(grid, basis, marched);
    float remaining = marched->transmittance;
    if (spheres) {
      sums += ShadeSpheres(grid, batch.rays[r], options.stop_transmittance, remaining,
                           spheres.get());
      remaining = spheres->transmittance;
      result.samples += spheres->num_samples;
    }
    Vec3f error;
    for (int a = 0; a < 3; ++a)
      error[a] = sums[a] + grid.background[a] * remaining - batch.targets[r][a];
    result.squared_error += Dot(error, error);
    result.samples += marched->num_samples;
    const Vec3f d_color = error * (2 * scale);
    Quad behind{grid.background.x, grid.background.y, grid.background.z, 0};
    if (spheres) ScatterSpheres(*spheres, d_color, &behind, &arena->spheres);
    ScatterRay(basis, d_color, behind, batch.losses, marched, arena);
  });
  return result;
}

void MaxWeights(const FastGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                float* weights) {
  const CornerOffsets offsets(grid.frame);
  MarchRays(grid, rays, n, options, [&](int64_t, const Marched* marched) {
    for (int64_t i = 0; i < marched->num_samples; ++i) {
      const Sample& s = marched->samples[static_cast<size_t>(i)];
      const float w = marched->weight(s);
      int32_t link[8];
      LoadLinks(grid, offsets, marched->block(s).vertex[s.lane], link);
      for (int k = 0; k < 8; ++k)
        if (link[k] >= 0) weights[link[k]] = std::max(weights[link[k]], w);
    }
  });
}

template <typename Body9, typename Body4, typename Body1>
auto ByBasis(int basis, const Body9& nine, const Body4& four, const Body1& one) {
  return basis == 9 ? nine() : basis == 4 ? four() : one();
}

}  // namespace

extern const FastRayFunctions kFunctions;  // external linkage
const FastRayFunctions kFunctions = {
    REGRADE_SIMD_NAME,
    [](const FastGrid& g, const Ray* rays, int64_t n, const MarchOptions& o, float* color,
       float* depth, float* transmittance) {
      ByBasis(
          g.basis, [&] { RenderRays<9>(g, rays, n, o, color, depth, transmittance); },
          [&] { RenderRays<4>(g, rays, n, o, color, depth, transmittance); },
          [&] { RenderRays<1>(g, rays, n, o, color, depth, transmittance); });
    },
    [](const FastGrid& g, const FastGrid& other, const Ray* rays, int64_t n,
       const MarchOptions& o, float* color, float* other_color, float* depth,
       float* transmittance) {
      const auto render = [&](auto basis) {
        const auto with = [&](auto of_other) {
          RenderPair<basis.value, of_other.value>(g, other, rays, n, o, color, other_color,
                                                  depth, transmittance);
        };
        ByBasis(
            other.basis, [&] { with(std::integral_constant<int, 9>()); },
            [&] { with(std::integral_constant<int, 4>()); },
            [&] { with(std::integral_constant<int, 1>()); });
      };
      ByBasis(
          g.basis, [&] { render(std::integral_constant<int, 9>()); },
          [&] { render(std::integral_constant<int, 4>()); },
          [&] { render(std::integral_constant<int, 1>()); });
    },
    [](const FastGrid& g, const RayBatch& b, const MarchOptions& o, float scale,
       GradientArena* arena) {
      return ByBasis(
          g.basis, [&] { return Accumulate<9>(g, b, o, scale, arena); },
          [&] { return Accumulate<4>(g, b, o, scale, arena); },
          [&] { return Accumulate<1>(g, b, o, scale, arena); });
    },
    MaxWeights,
    [](const FastGrid& g, int64_t begin, int64_t end, float density, float sh,
       GradientArena* arena) {
      ByBasis(
          g.basis, [&] { TotalVariation<9>(g, begin, end, density, sh, arena); },
          [&] { TotalVariation<4>(g, begin, end, density, sh, arena); },
          [&] { TotalVariation<1>(g, begin, end, density, sh, arena); });
    },
    [](FastGrid* g, float* moments, const GradientArena* arenas, int count, int self,
       int64_t begin, int64_t end, const RmspropOptions& o) {
      return ByBasis(
          g->basis, [&] { return Step<9>(g, moments, arenas, count, self, begin, end, o); },
          [&] { return Step<4>(g, moments, arenas, count, self, begin, end, o); },
          [&] { return Step<1>(g, moments, arenas, count, self, begin, end, o); });
    },
    [](const float* tau, int64_t n, float* alpha, float* decay) {
      for (int64_t i = 0; i < n; ++i) {
        const Extinction extinction = Extinguish(Fill(tau[i]));
        alpha[i] = extinction.alpha[i % kWide];
        decay[i] = extinction.decay[i % kWide];
      }
    },
};

}  // namespace regrade::REGRADE_SIMD_NAMESPACE
