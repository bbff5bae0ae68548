// The processor that runs a computation.
#pragma once

namespace regrade {

enum class Backend { kCpu, kCuda };

}  // namespace regrade
