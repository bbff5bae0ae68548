// The seen splats of a block of threads, so that all of its threads have one. Device code only.
#pragma once

#include <cstdint>

#if defined(__CUDACC__)

namespace regrade {

template <int kBlock>
struct SeenList {
  static constexpr int kRounds = 4;
  static constexpr int kChunk = kRounds * kBlock;  // splats of a block

  static unsigned Blocks(int64_t count) {
    return static_cast<unsigned>((count + kChunk - 1) / kChunk);
  }

  // Calls visit(i) for the splats of this block's chunk with tiles. Called by whole blocks.
  template <typename Visit>
  static __device__ void ForSeen(const int32_t* num_tiles, int64_t count, const Visit& visit) {
    constexpr int kWarps = kBlock / 32;
    __shared__ int in_warp[kRounds * kWarps];
    __shared__ uint16_t list[kChunk];
    const int thread = static_cast<int>(threadIdx.x), lane = thread % 32, warp = thread / 32;
    const int64_t first = blockIdx.x * int64_t{kChunk};
    unsigned seen[kRounds];
#pragma unroll
    for (int r = 0; r < kRounds; ++r) {
      const int64_t i = first + r * kBlock + thread;
      seen[r] = __ballot_sync(0xFFFFFFFF, i < count && num_tiles[i] > 0);
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
    for (int k = thread; k < total; k += kBlock) visit(first + list[k]);
  }
};

}  // namespace regrade

#endif
