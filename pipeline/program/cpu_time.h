// How much processor time this program has used: what a stage cost, whoever else was at work.
#pragma once

namespace regrade {

// Of all threads of this process and of the programs that it has started and seen end, seconds.
double CpuSeconds();

}  // namespace regrade
