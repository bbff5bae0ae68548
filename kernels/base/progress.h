// How a long loop reports where it is and learns whether to go on.
#pragma once

#include <functional>
#include <string>

namespace regrade {

enum class Verdict {
  kContinue,
  kFinish,  // stop early, but leave a usable result (a time budget is spent)
  kAbort,   // save a checkpoint and leave: the loop throws Interrupted
};

struct Progress {
  double done = 0.0;  // same unit as total; total <= 0 means unknown
  double total = 0.0;
  std::string note;  // one short clause for the progress line, e.g. "24.1 dB on training rays"
};

// Called often (every step); cheap when there is nothing to print.
using ProgressFunction = std::function<Verdict(const Progress&)>;

inline Verdict Report(const ProgressFunction& progress, double done, double total,
                      const std::string& note = "") {
  return progress ? progress({done, total, note}) : Verdict::kContinue;
}

}  // namespace regrade
