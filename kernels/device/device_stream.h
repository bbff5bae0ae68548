// Where device code launches its kernels: the stream that is being recorded, or the default
// one. Device code only.
#pragma once

#if defined(__CUDACC__)

namespace regrade {

cudaStream_t LaunchStream();

}  // namespace regrade

#endif
