// CPU seconds of this process and its children.
#pragma once

namespace regrade {

// Of all threads of this process and of all child processes that have ended.
double CpuSeconds();

}  // namespace regrade
