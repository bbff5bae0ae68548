// The fast path for processors with baseline instructions (the build adds their flags to this
// file alone).
#define REGRADE_SIMD_NAMESPACE simd_baseline
#define REGRADE_SIMD_NAME "baseline"
#include "kernels/field/cpu/rays_simd.h"
