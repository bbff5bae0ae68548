// Rays a second of the plain body and of the fast path, rendering and fitting, on one thread
// and on all, beside the bandwidth of a plain copy. Bytes a ray are counted: 8 corners x a
// record, read once to render; read, and its gradient read and written, to fit.
#include <benchmark/benchmark.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_weights.h"
#include "kernels/field/render_ray.h"
#include "kernels/optimize/rmsprop.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

constexpr int kSide = 128;

// A shell of matter in a 128^3 box, 0.7 M voxels: about as many samples a ray as a fitted photo
// capture.
const RadianceField& ShellField() {
  static const RadianceField field = [] {
    auto geometry = std::make_shared<Geometry>();
    geometry->frame = {{kSide, kSide, kSide}, {0, 0, 0}, {1, 1, 1}};
    geometry->links.Resize(geometry->frame.NumVertices());
    int32_t count = 0;
    for (int64_t v = 0; v < geometry->links.size(); ++v) {
      const Vec3f p = geometry->frame.WorldOf({static_cast<float>(v / (kSide * kSide)),
                                               static_cast<float>(v / kSide % kSide),
                                               static_cast<float>(v % kSide)});
      const float r = Norm(p);
      geometry->links[v] = r > 0.55f && r < 0.85f ? count++ : -1;
    }
    geometry->density.Resize(count);
    for (float& d : geometry->density) d = 4;
    RadianceField result;
    result.appearance.sh.Resize(static_cast<int64_t>(count) * 27);
    for (int64_t i = 0; i < result.appearance.sh.size(); ++i)
      result.appearance.sh[i] =
          static_cast<float>(RandomDouble(1, 2, static_cast<uint64_t>(i))) - 0.5f;
    result.geometry = geometry;
    return result;
  }();
  return field;
}

// Little squares of neighbouring rays, as a fit draws them.
std::vector<Ray> PatchRays(int n) {
  std::vector<Ray> rays;
  const std::vector<Ray> corners = testing::RandomRays(n / 4, 3);
  for (const Ray& corner : corners)
    for (int k = 0; k < 4; ++k) {
      Ray ray = corner;
      ray.direction.x += 0.001f * static_cast<float>(k & 1);
      ray.direction.y += 0.001f * static_cast<float>(k >> 1);
      ray.direction = Normalized(ray.direction);
      rays.push_back(ray);
    }
  return rays;
}

constexpr MarchOptions kMarch{0.5f, 1e-3f};

// Samples that composite, on average over some of the rays.
double SamplesARay(const std::vector<Ray>& rays) {
  const RayWeights weights =
      ComputeRayWeights(*ShellField().geometry, {rays.data(), 1024}, kMarch, 0.0f);
  return static_cast<double>(weights.samples.size()) / 1024;
}

void CountRays(benchmark::State& state, int64_t rays, double samples_a_ray, int times) {
  state.counters["rays/s"] = benchmark::Counter(static_cast<double>(rays),
                                                benchmark::Counter::kIsIterationInvariantRate);
  state.counters["samples/ray"] = samples_a_ray;
  state.counters["GB/s"] =
      benchmark::Counter(static_cast<double>(rays) * samples_a_ray * 8 * 128 * times * 1e-9,
                         benchmark::Counter::kIsIterationInvariantRate);
}

void BM_RenderPlain(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  const FieldView<float> view = ViewOf(ShellField());
  const std::vector<Ray> rays = PatchRays(4096);
  std::vector<Vec3f> color(rays.size());
  for (auto _ : state) {
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t r = 0; r < rays.size(); ++r) color[r] = RenderRay(view, rays[r], kMarch).color;
    benchmark::DoNotOptimize(color.data());
  }
  CountRays(state, static_cast<int64_t>(rays.size()), SamplesARay(rays), 1);
}

void BM_RenderFast(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  static const FastGrid grid = MakeFastGrid(ShellField());
  const std::vector<Ray> rays = PatchRays(16384);
  std::vector<float> color(3 * rays.size()), depth(rays.size()), transmittance(rays.size());
  for (auto _ : state) {
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t r = 0; r < rays.size(); r += 256)
      FastRays().render(grid, &rays[r], 256, kMarch, &color[3 * r], &depth[r],
                        &transmittance[r]);
    benchmark::DoNotOptimize(color.data());
  }
  CountRays(state, static_cast<int64_t>(rays.size()), SamplesARay(rays), 1);
}

// Forward, adjoint and one RMSProp step over every touched voxel, as the definitions have it.
void BM_FitPlain(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  RadianceField field = ShellField();
  Geometry geometry = *field.geometry;
  const std::vector<Ray> rays = PatchRays(4096);
  const size_t n = static_cast<size_t>(geometry.density.size());
  std::vector<float> d_density(n), d_sh(27 * n), m_density(n), m_sh(27 * n);
  const auto atomic_add = [](float* target, float value) {
#pragma omp atomic
    *target += value;
  };
  for (auto _ : state) {
    FieldView<float> view = ViewOf(field);
    view.density = geometry.density.data();
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t r = 0; r < rays.size(); ++r) {
      const RayResult<float> result = RenderRay(view, rays[r], kMarch);
      const Vec3f error = result.color - Vec3f{0.5f, 0.4f, 0.3f};
      RenderRayAdjoint(view, rays[r], kMarch, result, error * 1e-4f, d_density.data(),
                       d_sh.data(), atomic_add);
    }
    const auto step = [](float* x, float* g, float* m, float rate) {
      if (*g == 0) return;
      *m = *m == 0 ? *g * *g : 0.95f * *m + 0.05f * *g * *g;
      *x -= rate * *g / (std::sqrt(*m) + 1e-8f);
      *g = 0;
    };
#pragma omp parallel for schedule(static)
    for (size_t v = 0; v < n; ++v) {
      step(&geometry.density[static_cast<int64_t>(v)], &d_density[v], &m_density[v], 1e-6f);
      for (size_t k = 0; k < 27; ++k)
        step(&field.appearance.sh[static_cast<int64_t>(27 * v + k)], &d_sh[27 * v + k],
             &m_sh[27 * v + k], 1e-6f);
    }
  }
  CountRays(state, static_cast<int64_t>(rays.size()), SamplesARay(rays), 3);
}

void BM_FitFast(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  omp_set_num_threads(threads);
  FastGrid grid = MakeFastGrid(ShellField());
  Buffer<float> moments(grid.records.size());
  const std::vector<Ray> rays = PatchRays(8192);
  const std::vector<Vec3f> targets(rays.size(), Vec3f{0.5f, 0.4f, 0.3f});
  const int shards = static_cast<int>(state.range(1));
  std::vector<GradientArena> arenas(static_cast<size_t>(shards));
  for (auto& arena : arenas) arena.Reset(grid.num_voxels());
  int64_t samples = 0;
  const RmspropOptions optimizer{.rate_sh = 1e-6f, .rate_density = 1e-6f};
  for (auto _ : state) {
    samples = 0;
#pragma omp parallel for schedule(dynamic, 1) reduction(+ : samples)
    for (int s = 0; s < shards; ++s) {
      const size_t begin = rays.size() * static_cast<size_t>(s) / static_cast<size_t>(shards);
      const size_t end = rays.size() * static_cast<size_t>(s + 1) / static_cast<size_t>(shards);
      samples +=
          FastRays()
              .accumulate(grid,
                          {&rays[begin], &targets[begin], static_cast<int64_t>(end - begin)},
                          kMarch, 1e-4f, &arenas[static_cast<size_t>(s)])
              .samples;
    }
    for (int s = 0; s < shards; ++s) {
      const int64_t slots = arenas[static_cast<size_t>(s)].voxel_of_slot.size();
#pragma omp parallel for schedule(dynamic, 1)
      for (int64_t b = 0; b < slots; b += 2048)
        FastRays().step(&grid, moments.data(), arenas.data(), shards, s, b,
                        std::min(b + 2048, slots), optimizer);
    }
    for (auto& arena : arenas) arena.Forget();
  }
  CountRays(state, static_cast<int64_t>(rays.size()),
            static_cast<double>(samples) / static_cast<double>(rays.size()), 3);
}

void BM_Copy(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  const int64_t n = int64_t{1} << 28;  // bytes
  Buffer<char> from(n), to(n);
  for (auto _ : state) {
#pragma omp parallel for schedule(static)
    for (int64_t b = 0; b < n; b += 1 << 20)
      std::memcpy(to.data() + b, from.data() + b, 1 << 20);
    benchmark::ClobberMemory();
  }
  state.counters["GB/s"] = benchmark::Counter(2e-9 * static_cast<double>(n),
                                              benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK(BM_RenderPlain)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(BM_RenderFast)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(BM_FitPlain)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(BM_FitFast)
    ->ArgsProduct({{1, 2}, {1, 2, 4}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Copy)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace regrade

BENCHMARK_MAIN();
