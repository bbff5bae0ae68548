// The processor that does the work.
#pragma once

namespace regrade {

enum class Backend { kCpu, kCuda };

}  // namespace regrade
