// HD marks a function that both the host and a CUDA device may run.
#pragma once

#if defined(__CUDACC__)
#define HD __host__ __device__
#else
#define HD
#endif

// For functions shared with files that are compiled with instruction-set flags: the linker
// might keep the out-of-line copy made there for all callers, and it would crash on older
// processors.
#if defined(__CUDACC__)
#define REGRADE_ALWAYS_INLINE
#else
#define REGRADE_ALWAYS_INLINE __attribute__((always_inline)) inline
#endif
