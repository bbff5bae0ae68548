#include "kernels/device/device_memory.h"
#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/device_seen_depth.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

__global__ void WriteGradient(const SeenDepth* seen, int64_t count, float weight,
                              DepthPixels<const float> picture, DepthPixels<float> d) {
  const int64_t i = blockIdx.x * int64_t{kThreads} + threadIdx.x;
  if (i >= count) return;
  WriteDepthGradient(seen[i], count, weight, picture, d);
}

}  // namespace

void WriteDepthGradientOnDevice(const SeenDepth* seen, int64_t count, float weight,
                                const DepthPixels<const float>& picture,
                                const DepthPixels<float>& d) {
  if (count == 0) return;
  WriteGradient<<<BlocksFor(count), kThreads, 0, LaunchStream()>>>(seen, count, weight, picture,
                                                                   d);
  CheckLaunch("write_depth_gradient");
}

#else

void WriteDepthGradientOnDevice(const SeenDepth*, int64_t, float,
                                const DepthPixels<const float>&, const DepthPixels<float>&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
