// The seen splats of a block of threads, so that all of its threads have one. Device code only.
#pragma once

#include <cstdint>

#include "kernels/splats/cuda/device_math.h"

#if defined(__CUDACC__)

namespace regrade {

template <int kBlock>
struct SeenList {
  static constexpr int kRounds = 4;
  static constexpr int kChunk = kRounds * kBlock;  // splats of a block

  static unsigned Blocks(int64_t count) {
    return static_cast<unsigned>((count + kChunk - 1) / kChunk);
  }

  static __device__ int64_t First() { return blockIdx.x * int64_t{kChunk}; }

  // Fills list [kChunk] with the splats of this block's chunk that have tiles, in order,
  // counted from the chunk's first one; returns their number. Called by whole blocks, which it
  // lets wait.
  static __device__ int Make(const int32_t* num_tiles, int64_t count, uint16_t* list) {
    constexpr int kWarps = kBlock / 32;
    __shared__ int in_warp[kRounds * kWarps];
    const int thread = static_cast<int>(threadIdx.x), lane = thread % 32, warp = thread / 32;
    const int64_t first = First();
    unsigned seen[kRounds];
#pragma unroll
    for (int r = 0; r < kRounds; ++r) {
      const int64_t i = first + r * kBlock + thread;
      seen[r] = __ballot_sync(kWholeWarp, i < count && num_tiles[i] > 0);
      if (lane == 0) in_warp[r * kWarps + warp] = __popc(seen[r]);
    }
    __syncthreads();
    int before = 0, total = 0;
#pragma unroll
    for (int r = 0; r < kRounds; ++r) {
      for (int w = 0; w < kWarps; ++w) {
        if (w == warp) before = total;
        total += in_warp[r * kWarps + w];
      }
      if (seen[r] >> lane & 1)
        list[before + __popc(seen[r] & ((1u << lane) - 1))] =
            static_cast<uint16_t>(r * kBlock + thread);
    }
    __syncthreads();
    return total;
  }
};

}  // namespace regrade

#endif
