// One body for two processors: HD marks a function that both the host and a CUDA device may
// run.
#pragma once

#if defined(__CUDACC__)
#define HD __host__ __device__
#else
#define HD
#endif
