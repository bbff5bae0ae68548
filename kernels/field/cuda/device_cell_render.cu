#include "kernels/base/error.h"
#include "kernels/field/cuda/cell_ray.h"
#include "kernels/field/cuda/device_cell_render.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/rendered_rays.h"

namespace regrade {

VertexColors MakeVertexColors(const DeviceGrid& grid) {
  REGRADE_CHECK(grid.cells.on());
  return {DeviceBuffer<float>(4 * grid.num_voxels(), "colours of vertices")};
}

#if defined(__CUDACC__)

namespace {

constexpr int kBlock = 128;  // rays; four tiles of 8 x 4 pixels of a frame

template <int kBasis>
__global__ void VertexColorsKernel(DeviceGridView grid, PinholeRays camera,
                                   FourFloats* colors) {
  const int64_t v = blockIdx.x * int64_t{blockDim.x} + threadIdx.x;
  if (v < grid.num_voxels)
    colors[v] = ColorOfVertex<kBasis>(grid, camera, static_cast<int32_t>(v));
}

template <int kBasis, bool kColors, typename Rays>
__global__ void __launch_bounds__(kBlock)
    RenderCellsKernel(DeviceGridView grid, Rays rays, const FourFloats* colors,
                      float wide_until, float stop, DeviceRenderTarget target, bool resolve) {
  Ray ray;
  int64_t place;
  if (!rays.Get(blockIdx.x * int64_t{kBlock} + threadIdx.x, &ray, &place)) return;
  CellRaySums sums = RenderCellRay<kBasis, kColors>(grid, ray, colors, wide_until, stop);
  if (resolve) rays.Resolve(ray, sums.transmittance, &sums.color, &sums.depth);
  target.color[place] = sums.color;
  target.depth[place] = sums.depth;
  target.transmittance[place] = sums.transmittance;
}

// `colors` is null where every sample is evaluated from the records.
template <typename Rays>
void Render(const DeviceGrid& grid, const Rays& rays, const FourFloats* colors,
            float wide_until, const MarchOptions& options, const DeviceRenderTarget& target) {
  const int64_t n = rays.Blocks() * kRenderedRays;
  if (n == 0) return;
  DeviceGridView view = grid.view();
  const bool resolve = !grid.spheres.on();
  if (!resolve) view.background = {};  // the layers are composited before it
  const auto blocks = static_cast<unsigned>((n + kBlock - 1) / kBlock);
  ByBasis(grid.basis, colors != nullptr, [&](auto basis, auto from_colors) {
    RenderCellsKernel<basis.value, from_colors.value><<<blocks, kBlock>>>(
        view, rays, colors, wide_until, options.stop_transmittance, target, resolve);
  });
  CheckLaunch("render_cells");
  if (resolve) return;
  RenderSpheresKernel<<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays,
                                                       options.stop_transmittance, target);
  CheckLaunch("render_spheres");
}

// The ray length below which a cell of one voxel is wide. Directions in NDC of one camera are
// nearly parallel, and lengths there begin at the near plane: no cell is wide.
float WideUntil(const DeviceGrid& grid, const Camera& camera, float wide_angle) {
  if (camera.ndc.on()) return 0;
  const Vec3f scale = grid.frame.Scale();
  return 1 / (std::fmin(scale.x, std::fmin(scale.y, scale.z)) * wide_angle);
}

}  // namespace

void RenderCellRays(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target) {
  Render(grid, ListedRays{rays, n}, nullptr, 0, options, target);
}

void RenderCellFrame(const DeviceGrid& grid, const Camera& camera, const MarchOptions& options,
                     const DeviceRenderTarget& target, const VertexColors* colors,
                     float wide_angle) {
  const FrameRays rays{PinholeRays(camera), ResolvePixel(camera)};
  if (colors == nullptr || colors->empty()) {
    Render(grid, rays, nullptr, 0, options, target);
    return;
  }
  auto* const of_vertices = reinterpret_cast<FourFloats*>(colors->values.data());
  ByBasis(grid.basis, [&](auto basis) {
    VertexColorsKernel<basis.value>
        <<<BlocksFor(grid.num_voxels()), kThreads>>>(grid.view(), rays.camera, of_vertices);
  });
  CheckLaunch("vertex_colors");
  Render(grid, rays, of_vertices, WideUntil(grid, camera, wide_angle), options, target);
}

#else

void RenderCellRays(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&) {
  DeviceWait("render_cells");
}
void RenderCellFrame(const DeviceGrid&, const Camera&, const MarchOptions&,
                     const DeviceRenderTarget&, const VertexColors*, float) {
  DeviceWait("render_cells");
}

#endif

}  // namespace regrade
