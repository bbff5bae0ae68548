// One body for two processors: HD marks a function that both the host and a CUDA device may
// run.
#pragma once

#if defined(__CUDACC__)
#define HD __host__ __device__
#else
#define HD
#endif

// For functions that files with instruction-set flags share with others: an out-of-line copy
// made there could be the one the linker keeps for all, and end older processors.
#if defined(__CUDACC__)
#define REGRADE_ALWAYS_INLINE
#else
#define REGRADE_ALWAYS_INLINE __attribute__((always_inline)) inline
#endif
