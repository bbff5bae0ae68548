#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/pixel_gradients.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// The sum of a warp's values, in a fixed order; valid in lane 0.
template <typename T>
__device__ T SumOfWarp(T value) {
  for (int step = 16; step > 0; step /= 2) value += __shfl_down_sync(kWholeWarp, value, step);
  return value;
}

// A thread for each pixel of a tile.
__global__ void Gather(TileGrid grid, SplatPixels<float> picture, SplatPixels<const float> d,
                       TileGradients gradients) {
  const int64_t thread = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int tile = static_cast<int>(thread / kTilePixels);
  const int pixel = static_cast<int>(thread % kTilePixels);
  if (tile >= grid.count()) return;  // whole warps
  const int x = tile % grid.columns * kDeviceTile + pixel % kDeviceTile;
  const int y = tile / grid.columns * kDeviceTile + pixel / kDeviceTile;
  PixelGradient own{};
  Vec3f background{};
  float d_depth = 0;
  if (x < grid.width && y < grid.height) {
    const int64_t at = int64_t{y} * grid.width + x;
    for (int c = 0; c < 3; ++c) own.color[c] = d.color != nullptr ? d.color[3 * at + c] : 0.0f;
    for (int c = 0; c < 3; ++c) own.total += picture.color[3 * at + c] * own.color[c];
    const float t = picture.transmittance[at];
    background = own.color * t;
    if (d.transmittance != nullptr) own.total += t * d.transmittance[at];
    if (d.depth != nullptr) {
      d_depth = d.depth[at];
      own.total += picture.depth[at] * d_depth;
    }
  }
  gradients.pixel[thread] = own;
  if (gradients.depth != nullptr) gradients.depth[thread] = d_depth;
  for (int c = 0; c < 3; ++c) background[c] = SumOfWarp(background[c]);
  if (threadIdx.x % 32 == 0) gradients.background[thread / 32] = background;
}

// One block.
__global__ void SumBackground(const Vec3f* part, int count, Vec3f* sum) {
  __shared__ double warps[32][3];
  Vec3d own{};
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x))
    own += part[i].Cast<double>();
  for (int c = 0; c < 3; ++c) {
    const double total = SumOfWarp(own[c]);
    if (threadIdx.x % 32 == 0) warps[threadIdx.x / 32][c] = total;
  }
  __syncthreads();
  if (threadIdx.x >= 3) return;
  double total = 0;
  for (unsigned w = 0; w < blockDim.x / 32; ++w) total += warps[w][threadIdx.x];
  (*sum)[static_cast<int>(threadIdx.x)] = static_cast<float>(total);
}

}  // namespace

void GatherPixelGradients(const TileGrid& grid, const SplatPixels<float>& picture,
                          const SplatPixels<const float>& d, const TileGradients& gradients) {
  Gather<<<BlocksFor(int64_t{grid.count()} * kTilePixels), kThreads, 0, LaunchStream()>>>(
      grid, picture, d, gradients);
  SumBackground<<<1, 1024, 0, LaunchStream()>>>(gradients.background, 2 * grid.count(),
                                                gradients.d_background);
  CheckLaunch("gather_pixel_gradients");
}

#else

void GatherPixelGradients(const TileGrid&, const SplatPixels<float>&,
                          const SplatPixels<const float>&, const TileGradients&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
