#include "kernels/base/random.h"
#include "kernels/field/cuda/device_free_space.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"

namespace regrade {

#if defined(__CUDACC__)

struct DeviceFreeSpace::Stream {
  cudaStream_t stream;
  cudaEvent_t fork, join;

  Stream() {
    cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking);
    cudaEventCreateWithFlags(&fork, cudaEventDisableTiming);
    cudaEventCreateWithFlags(&join, cudaEventDisableTiming);
  }
  ~Stream() {
    cudaStreamSynchronize(stream);
    cudaStreamDestroy(stream);
    cudaEventDestroy(fork);
    cudaEventDestroy(join);
  }
};

namespace {

template <bool kExact>
__global__ void FreeSpaceKernel(DeviceGridView grid, int lane, const FreeRay* rays,
                                int64_t size, uint64_t seed, uint64_t step, int n, float scale,
                                GradientView gradient) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= n) return;
  const FreeRay free = rays[RandomIndex(seed, step, i, size)];
  const float opacity = OpacityBefore(grid.frame, grid.cells, grid.dense_density, free.ray,
                                      grid.near_clip, free.length);
  if (!(opacity > 0)) return;
  OpacityBeforeAdjoint(grid.frame, grid.cells, grid.dense_density, free.ray, grid.near_clip,
                       free.length, opacity, scale, [&](int32_t vertex, float d) {
                         Touch(gradient.touched, vertex);
                         float* const row = gradient.gradient + vertex * grid.stride;
                         if constexpr (kExact)
                           AddExact(row, lane, d);
                         else
                           atomicAdd(row + lane, d);
                       });
}

}  // namespace

void DeviceFreeSpace::Accumulate(const DeviceGrid& grid, uint64_t seed, uint64_t step, int n,
                                 float weight, DeviceTouched* touched) {
  if (size() == 0 || n <= 0 || !(weight > 0)) return;
  REGRADE_CHECK(grid.fitting && grid.cells.on());
  constexpr int kBlock = 32;  // few rays: as many multiprocessors as possible
  const unsigned blocks = static_cast<unsigned>((n + kBlock - 1) / kBlock);
  const GradientView view{grid.gradient(), touched->bits.data()};
  const int lane = DensityLane(grid.basis);
  const float scale = weight / static_cast<float>(n);
  cudaEventRecord(stream_->fork, nullptr);
  cudaStreamWaitEvent(stream_->stream, stream_->fork, 0);
  if (grid.exact_sums)
    FreeSpaceKernel<true><<<blocks, kBlock, 0, stream_->stream>>>(
        grid.view(), lane, rays_.data(), size(), seed, step, n, scale, view);
  else
    FreeSpaceKernel<false><<<blocks, kBlock, 0, stream_->stream>>>(
        grid.view(), lane, rays_.data(), size(), seed, step, n, scale, view);
  CheckLaunch("free_space");
  cudaEventRecord(stream_->join, stream_->stream);
}

void DeviceFreeSpace::Join() {
  if (size() > 0) cudaStreamWaitEvent(nullptr, stream_->join, 0);
}

#else

struct DeviceFreeSpace::Stream {};

void DeviceFreeSpace::Accumulate(const DeviceGrid&, uint64_t, uint64_t, int, float,
                                 DeviceTouched*) {
  DeviceWait("free_space");
}
void DeviceFreeSpace::Join() {}

#endif

DeviceFreeSpace::DeviceFreeSpace(const std::vector<FreeRay>& rays) {
  if (rays.empty()) return;
  rays_ = DeviceBuffer<FreeRay>(static_cast<int64_t>(rays.size()), "rays of free space");
  rays_.CopyIn(rays.data(), rays_.size());
  stream_ = std::make_unique<Stream>();
}
DeviceFreeSpace::~DeviceFreeSpace() = default;

}  // namespace regrade
