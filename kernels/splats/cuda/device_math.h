// Single instructions of the device's arithmetic, the same in every kernel. Device code only.
#pragma once

#if defined(__CUDACC__)

namespace regrade {

constexpr unsigned kWholeWarp = 0xFFFFFFFF;  // a mask of lanes

// 2^x to 2 units in the last place.
__device__ inline float FastExp2(float x) {
  float result;
  asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}

// 1 / x to 1 unit in the last place.
__device__ inline float FastReciprocal(float x) {
  float result;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}

// The root to 1 unit in the last place.
__device__ inline float FastRoot(float x) {
  float result;
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}

}  // namespace regrade

#endif
