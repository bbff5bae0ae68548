#include "kernels/image/cuda/device_picture_loss.h"

#if defined(__CUDACC__)
#include "kernels/device/device_stream.h"
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kSide = 16;                      // pixels of a block, both sides
constexpr int kWide = kSide + 2 * kSsimReach;  // with what its windows reach
constexpr int kTaps = 2 * kSsimReach + 1;
constexpr int kThreadsOfBlock = kSide * kSide;
__constant__ float kTap[kTaps];

struct Pixels {
  int width, height;
  const uint16_t* photo;
  const uint8_t* masked;  // may be null
  const float* picture;

  __device__ bool Inside(int x, int y) const {
    return x >= 0 && y >= 0 && x < width && y < height;
  }
  __device__ int64_t At(int x, int y) const { return static_cast<int64_t>(y) * width + x; }
  // 0 where the pixel is masked or beyond the border.
  __device__ bool Load(int x, int y, int c, float* own, float* seen) const {
    *own = *seen = 0;
    if (!Inside(x, y)) return false;
    const int64_t at = At(x, y);
    if (masked != nullptr && masked[at] != 0) return false;
    *own = static_cast<float>(photo[3 * at + c]) * (1 / 65535.0f);
    *seen = picture[3 * at + c];
    return true;
  }
};

// Sums `kCount` planes of a tile [kWide, kWide] under the window at this thread's pixel.
// value(row, column, out) gives the planes at a place of the tile; `rows` is scratch.
template <int kCount, typename Value>
__device__ void Window(const Value& value, float (*rows)[kWide][kSide], float* result) {
  const int thread = static_cast<int>(threadIdx.x);
  for (int place = thread; place < kWide * kSide; place += kThreadsOfBlock) {
    const int row = place / kSide, column = place % kSide;
    float sum[kCount] = {};
    for (int k = 0; k < kTaps; ++k) {
      float of[kCount];
      value(row, column + k, of);
      for (int p = 0; p < kCount; ++p) sum[p] += kTap[k] * of[p];
    }
    for (int p = 0; p < kCount; ++p) rows[p][row][column] = sum[p];
  }
  __syncthreads();
  const int x = thread % kSide, y = thread / kSide;
  for (int p = 0; p < kCount; ++p) result[p] = 0;
  for (int k = 0; k < kTaps; ++k)
    for (int p = 0; p < kCount; ++p) result[p] += kTap[k] * rows[p][y + k][x];
  __syncthreads();
}

// Adds the threads' sums, pairwise; the first thread has the result.
__device__ PictureSums SumOfBlock(const PictureSums& own) {
  __shared__ double of[3][kThreadsOfBlock];
  __shared__ int64_t values[kThreadsOfBlock];
  const int thread = static_cast<int>(threadIdx.x);
  of[0][thread] = own.absolute, of[1][thread] = own.squared, of[2][thread] = own.similarity;
  values[thread] = own.values;
  for (int half = kThreadsOfBlock / 2; half > 0; half /= 2) {
    __syncthreads();
    if (thread >= half) continue;
    for (int k = 0; k < 3; ++k) of[k][thread] += of[k][thread + half];
    values[thread] += values[thread + half];
  }
  return {of[0][0], of[1][0], of[2][0], values[0]};
}

// The gradient of the absolute difference, and the derivatives of S.
__global__ void __launch_bounds__(kThreadsOfBlock)
    SlopesKernel(Pixels pixels, float weight, float* slopes, float* d, PictureSums* of_block) {
  __shared__ float own[kWide][kWide], seen[kWide][kWide], rows[5][kWide][kSide];
  const int thread = static_cast<int>(threadIdx.x);
  const int x0 = static_cast<int>(blockIdx.x) * kSide,
            y0 = static_cast<int>(blockIdx.y) * kSide;
  const int x = x0 + thread % kSide, y = y0 + thread / kSide;
  const int64_t plane = 3 * static_cast<int64_t>(pixels.width) * pixels.height;
  PictureSums sums;
  for (int c = 0; c < 3; ++c) {
    for (int place = thread; place < kWide * kWide; place += kThreadsOfBlock) {
      const int row = place / kWide, column = place % kWide;
      pixels.Load(x0 + column - kSsimReach, y0 + row - kSsimReach, c, &own[row][column],
                  &seen[row][column]);
    }
    __syncthreads();
    float blurred[5];
    Window<5>(
        [&](int row, int column, float* of) {
          const float a = seen[row][column], b = own[row][column];
          of[0] = a, of[1] = a * a, of[2] = a * b, of[3] = b, of[4] = b * b;
        },
        rows, blurred);
    if (!pixels.Inside(x, y)) continue;
    const int64_t at = 3 * pixels.At(x, y) + c;
    const SsimSlopes<float> of =
        SsimOf(blurred[0], blurred[1], blurred[2], blurred[3], blurred[4]);
    slopes[at] = of.by_p;
    slopes[plane + at] = of.by_q;
    slopes[2 * plane + at] = of.by_r;
    sums.similarity += of.s;
    float a, b;
    d[at] = 0;
    if (!pixels.Load(x, y, c, &b, &a)) continue;
    const float difference = a - b;
    d[at] = difference > 0 ? weight : difference < 0 ? -weight : 0.0f;
    sums.absolute += fabsf(difference);
    sums.squared += difference * difference;
    sums.values += 1;
  }
  const PictureSums all = SumOfBlock(sums);
  if (thread == 0) of_block[blockIdx.y * gridDim.x + blockIdx.x] = all;
}

__global__ void __launch_bounds__(kThreadsOfBlock)
    GradientKernel(Pixels pixels, float weight, const float* slopes, float* d) {
  __shared__ float by[3][kWide][kWide], rows[3][kWide][kSide];
  const int thread = static_cast<int>(threadIdx.x);
  const int x0 = static_cast<int>(blockIdx.x) * kSide,
            y0 = static_cast<int>(blockIdx.y) * kSide;
  const int x = x0 + thread % kSide, y = y0 + thread / kSide;
  const int64_t plane = 3 * static_cast<int64_t>(pixels.width) * pixels.height;
  for (int c = 0; c < 3; ++c) {
    for (int place = thread; place < kWide * kWide; place += kThreadsOfBlock) {
      const int row = place / kWide, column = place % kWide;
      const int u = x0 + column - kSsimReach, v = y0 + row - kSsimReach;
      const bool inside = pixels.Inside(u, v);
      for (int p = 0; p < 3; ++p)
        by[p][row][column] = inside ? slopes[p * plane + 3 * pixels.At(u, v) + c] : 0.0f;
    }
    __syncthreads();
    float blurred[3];
    Window<3>(
        [&](int row, int column, float* of) {
          for (int p = 0; p < 3; ++p) of[p] = by[p][row][column];
        },
        rows, blurred);
    float a, b;
    if (!pixels.Inside(x, y) || !pixels.Load(x, y, c, &b, &a)) continue;
    d[3 * pixels.At(x, y) + c] -= weight * (blurred[0] + 2 * a * blurred[1] + b * blurred[2]);
  }
}

// One block: the sums of all blocks of pixels.
__global__ void __launch_bounds__(kThreadsOfBlock)
    AddKernel(const PictureSums* of_block, int64_t count, PictureSums* sums) {
  PictureSums own;
  for (int64_t k = threadIdx.x; k < count; k += kThreadsOfBlock) {
    own.absolute += of_block[k].absolute;
    own.squared += of_block[k].squared;
    own.similarity += of_block[k].similarity;
    own.values += of_block[k].values;
  }
  const PictureSums all = SumOfBlock(own);
  if (threadIdx.x != 0) return;
  sums->absolute += all.absolute;
  sums->squared += all.squared;
  sums->similarity += all.similarity;
  sums->values += all.values;
}

}  // namespace

void DevicePictureLoss::Compare(int width, int height, const uint16_t* photo,
                                const uint8_t* masked, const float* picture, float lambda,
                                float* d_picture) {
  const int64_t plane = 3 * static_cast<int64_t>(width) * height;
  const dim3 blocks((width + kSide - 1) / kSide, (height + kSide - 1) / kSide);
  const int64_t count = static_cast<int64_t>(blocks.x) * blocks.y;
  if (slopes_.size() < 3 * plane) slopes_ = DeviceBuffer<float>(3 * plane, "slopes of SSIM");
  if (of_block_.size() < count) of_block_ = DeviceBuffer<PictureSums>(count, "sums of pixels");
  if (sums_.empty()) {
    sums_ = DeviceBuffer<PictureSums>(1, "sums of pictures");
    sums_.Zero();
    const std::vector<float> taps = SsimTaps<float>();
    cudaMemcpyToSymbol(kTap, taps.data(), sizeof(float) * kTaps);
  }
  const Pixels pixels{width, height, photo, masked, picture};
  const float per_value = static_cast<float>(1.0 / static_cast<double>(plane));
  SlopesKernel<<<blocks, kThreadsOfBlock, 0, LaunchStream()>>>(
      pixels, (1 - lambda) * per_value, slopes_.data(), d_picture, of_block_.data());
  CheckLaunch("slopes_of_ssim");
  GradientKernel<<<blocks, kThreadsOfBlock, 0, LaunchStream()>>>(pixels, lambda * per_value,
                                                                 slopes_.data(), d_picture);
  CheckLaunch("gradient_of_ssim");
  AddKernel<<<1, kThreadsOfBlock, 0, LaunchStream()>>>(of_block_.data(), count, sums_.data());
  CheckLaunch("sums_of_pictures");
}

#else

void DevicePictureLoss::Compare(int, int, const uint16_t*, const uint8_t*, const float*, float,
                                float*) {
  DeviceWait("picture_loss");
}

#endif

PictureSums DevicePictureLoss::TakeSums() {
  PictureSums sums;
  if (sums_.empty()) return sums;
  sums_.CopyOut(&sums, 1);
  sums_.Zero();
  return sums;
}

}  // namespace regrade
