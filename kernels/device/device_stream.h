// The stream on which device code launches kernels: the capturing one, or the default one.
// Device code only.
#pragma once

#if defined(__CUDACC__)

namespace regrade {

cudaStream_t LaunchStream();

}  // namespace regrade

#endif
