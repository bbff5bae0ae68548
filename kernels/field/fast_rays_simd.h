// Body of the fast path, compiled once an instruction set: define REGRADE_SIMD_NAMESPACE before
// including. Only GCC's vector types are used, so the same text becomes SSE, AVX2 or AVX-512.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "kernels/field/fast_rays.h"
#include "kernels/field/fast_step_simd.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

struct Sample {
  int32_t link[8];
  float corner_weight[8];
  float raw[3];  // before the clamp
  float tau;
  float transmittance_before;
  float alpha;
  float t;  // voxels
};

struct Marched {
  float delta = 0;  // world length of a step
  float world_per_voxel = 0;
  float transmittance = 1;
};

inline void CornerWeights(const Vec3f& f, float* w) {
  const float x0 = 1 - f.x, y0 = 1 - f.y, z0 = 1 - f.z;
  const float x0y0 = x0 * y0, x0y1 = x0 * f.y, x1y0 = f.x * y0, x1y1 = f.x * f.y;
  w[0] = x0y0 * z0, w[1] = x0y0 * f.z, w[2] = x0y1 * z0, w[3] = x0y1 * f.z;
  w[4] = x1y0 * z0, w[5] = x1y0 * f.z, w[6] = x1y1 * z0, w[7] = x1y1 * f.z;
}

// Walks the density and keeps the samples that composite. Skipping steps through cells without
// stored corners leaves out exact zeros only.
Marched March(const FastGrid& grid, const Ray& ray, const MarchOptions& options,
              std::vector<Sample>* samples) {
  samples->clear();
  const GridFrame& frame = grid.frame;
  const GridRay<float> march = ClipToGrid(frame, ray, grid.near_clip, options.step);
  Marched result;
  result.world_per_voxel = march.world_per_voxel;
  result.delta = options.step * march.world_per_voxel;
  const int32_t stride_y = frame.resolution.z;
  const int32_t stride_x = frame.resolution.y * frame.resolution.z;
  const int32_t offsets[8] = {0,
                              1,
                              stride_y,
                              stride_y + 1,
                              stride_x,
                              stride_x + 1,
                              stride_x + stride_y,
                              stride_x + stride_y + 1};
  float transmittance = 1;
  for (int64_t i = 0; i < march.num_steps;) {
    const float t = march.t_begin + static_cast<float>(i) * options.step;
    const Cell<float> cell = LocateCell(frame, march.At(t));
    const int distance = grid.empty_distance[cell.vertex];
    if (distance > 0) {
      // Every cell nearer than `distance` is empty, and a coordinate moves by at most the
      // length walked.
      const int64_t skip =
          static_cast<int64_t>(static_cast<float>(distance - 1) / options.step);
      i += skip > 1 ? skip : 1;
      continue;
    }
    ++i;
    float w[8];
    CornerWeights(cell.fraction, w);
    const float* d = grid.dense_density.data() + cell.vertex;
    float density = 0;
    for (int k = 0; k < 8; ++k) density += w[k] * d[offsets[k]];
    if (!(density > 0)) continue;
    samples->emplace_back();
    Sample& sample = samples->back();
    const int32_t* links = grid.links.data() + cell.vertex;
    for (int k = 0; k < 8; ++k) {
      sample.corner_weight[k] = w[k];
      sample.link[k] = links[offsets[k]];
    }
    sample.tau = OpticalDepth(density, result.delta);
    sample.alpha = Opacity(sample.tau);
    sample.transmittance_before = transmittance;
    sample.t = t;
    transmittance *= 1 - sample.alpha;
    if (transmittance < options.stop_transmittance) break;
  }
  result.transmittance = transmittance;
  return result;
}

template <int kBasis>
inline void Prefetch(const FastGrid& grid, const Sample& sample) {
  constexpr int kLanes = RecordLanes(kBasis);
  for (int k = 0; k < 8; ++k) {
    if (sample.link[k] < 0) continue;
    const float* p = grid.records.data() + static_cast<int64_t>(sample.link[k]) * kLanes;
    __builtin_prefetch(p);
    if (kLanes > 16) __builtin_prefetch(p + 16);
  }
}

// `basis_record` holds gamma three times, so a colour is three sums of products.
template <int kBasis>
inline void ColorOf(const FastGrid& grid, const Record<kBasis>& basis_record, Sample* sample) {
  constexpr int kLanes = RecordLanes(kBasis);
  auto sum = Record<kBasis>::Zero();
  for (int k = 0; k < 8; ++k) {
    if (sample->link[k] < 0) continue;
    sum.AddScaled(sample->corner_weight[k],
                  grid.records.data() + static_cast<int64_t>(sample->link[k]) * kLanes);
  }
  for (int i = 0; i < RecordShape<kBasis>::kCount; ++i) sum.v[i] *= basis_record.v[i];
  alignas(64) float product[kLanes];
  sum.Store(product);
  for (int c = 0; c < 3; ++c) {
    float value = 0.5f;
    for (int k = 0; k < kBasis; ++k) value += product[c * kBasis + k];
    sample->raw[c] = value;
  }
}

template <int kBasis>
Record<kBasis> BasisRecord(const Vec3f& direction) {
  float gamma[kMaxBasis];
  ShBasis(kBasis, direction, gamma);
  alignas(64) float lanes[RecordLanes(kBasis)] = {};
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kBasis; ++k) lanes[c * kBasis + k] = gamma[k];
  return Record<kBasis>::Load(lanes);
}

template <int kBasis>
Vec3f Shade(const FastGrid& grid, const Record<kBasis>& basis_record, const Marched& marched,
            std::vector<Sample>* samples) {
  constexpr size_t kAhead = 3;
  Vec3f color{};
  for (size_t i = 0; i < samples->size(); ++i) {
    if (i + kAhead < samples->size()) Prefetch<kBasis>(grid, (*samples)[i + kAhead]);
    Sample& s = (*samples)[i];
    ColorOf<kBasis>(grid, basis_record, &s);
    const float w = s.transmittance_before * s.alpha;
    for (int c = 0; c < 3; ++c) color[c] += w * std::max(s.raw[c], 0.0f);
  }
  return color + grid.background * marched.transmittance;
}

template <int kBasis>
void RenderRays(const FastGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                float* color, float* depth, float* transmittance) {
  std::vector<Sample> samples;
  for (int64_t r = 0; r < n; ++r) {
    const Marched marched = March(grid, rays[r], options, &samples);
    const Vec3f c =
        Shade<kBasis>(grid, BasisRecord<kBasis>(rays[r].direction), marched, &samples);
    for (int a = 0; a < 3; ++a) color[3 * r + a] = c[a];
    float sum = 0;
    for (const Sample& s : samples) sum += s.transmittance_before * s.alpha * s.t;
    depth[r] = sum * marched.world_per_voxel;
    transmittance[r] = marched.transmittance;
  }
}

template <int kBasis>
FitStepResult Accumulate(const FastGrid& grid, const RayBatch& batch,
                         const MarchOptions& options, float scale, GradientArena* arena) {
  constexpr int kLanes = RecordLanes(kBasis);
  using R = Record<kBasis>;
  FitStepResult result;
  std::vector<Sample> samples;
  for (int64_t r = 0; r < batch.size; ++r) {
    const Marched marched = March(grid, batch.rays[r], options, &samples);
    const R basis_record = BasisRecord<kBasis>(batch.rays[r].direction);
    const Vec3f color = Shade<kBasis>(grid, basis_record, marched, &samples);
    const Vec3f error = color - batch.targets[r];
    result.squared_error += Dot(error, error);
    result.samples += static_cast<int64_t>(samples.size());
    ReserveSlots(arena, 8 * static_cast<int64_t>(samples.size()), kLanes);

    const Vec3f d_color = error * (2 * scale);
    Vec3f behind = grid.background;
    for (size_t i = samples.size(); i-- > 0;) {
      const Sample& s = samples[i];
      const float w = s.transmittance_before * s.alpha;
      // See EQ(composite-adjoint).
      const Vec3f c{std::max(s.raw[0], 0.0f), std::max(s.raw[1], 0.0f),
                    std::max(s.raw[2], 0.0f)};
      const float transmittance_after = s.transmittance_before * (1 - s.alpha);
      float d_sigma = marched.delta * transmittance_after * Dot(c - behind, d_color);
      if (!(s.tau < static_cast<float>(kMaxOpticalDepth))) d_sigma = 0;
      behind = c * s.alpha + behind * (1 - s.alpha);

      alignas(64) float factor[kLanes] = {};
      for (int ch = 0; ch < 3; ++ch) {
        const float d = s.raw[ch] > 0 ? w * d_color[ch] : 0.0f;
        for (int k = 0; k < kBasis; ++k) factor[ch * kBasis + k] = d;
      }
      R d_record = R::Load(factor);
      for (int j = 0; j < RecordShape<kBasis>::kCount; ++j) d_record.v[j] *= basis_record.v[j];
      d_record.v[DensityLane(kBasis) / RecordShape<kBasis>::kWidth]
                [DensityLane(kBasis) % RecordShape<kBasis>::kWidth] = d_sigma;
      for (int k = 0; k < 8; ++k) {
        if (s.link[k] < 0) continue;
        float* slot = SlotOf(arena, s.link[k], kLanes);
        R sum = R::Load(slot);
        for (int j = 0; j < RecordShape<kBasis>::kCount; ++j)
          sum.v[j] += s.corner_weight[k] * d_record.v[j];
        sum.Store(slot);
      }
    }
  }
  return result;
}

void MaxWeights(const FastGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                float* weights) {
  std::vector<Sample> samples;
  for (int64_t r = 0; r < n; ++r) {
    March(grid, rays[r], options, &samples);
    for (const Sample& s : samples) {
      const float w = s.transmittance_before * s.alpha;
      for (int k = 0; k < 8; ++k)
        if (s.link[k] >= 0) weights[s.link[k]] = std::max(weights[s.link[k]], w);
    }
  }
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
};

}  // namespace regrade::REGRADE_SIMD_NAMESPACE
