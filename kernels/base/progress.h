// Progress reports of long loops, and the decision whether to continue.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {

enum class LoopControl {
  kContinue,
  kStop,  // save a checkpoint and return: the loop throws Interrupted
};

struct Progress {
  double done = 0.0;  // same unit as total; total <= 0 means unknown
  double total = 0.0;
  std::string note;  // one short clause for the progress line, e.g. "24.1 dB on training rays"
};

// Called often (every step); must be cheap when there is nothing to print.
using ProgressFunction = std::function<LoopControl(const Progress&)>;

inline LoopControl Report(const ProgressFunction& progress, double done, double total,
                          const std::string& note = "") {
  return progress ? progress({done, total, note}) : LoopControl::kContinue;
}

// The same for a loop without a state to save.
inline void ReportOrThrow(const ProgressFunction& progress, double done, double total,
                          const std::string& note = "") {
  if (Report(progress, done, total, note) == LoopControl::kStop) throw Interrupted();
}

// Combines the progress of several parts, each reporting from 0 to its own total. `whole` gets
// the weights of the finished parts plus the finished fraction of the current one, so that the
// remaining time covers all parts.
class ProgressParts {
 public:
  // total_weight: the sum of the weights passed to Next; expected seconds are suitable weights.
  ProgressParts(ProgressFunction whole, double total_weight)
      : whole_(std::move(whole)), total_(total_weight) {}

  // The progress function of the next part; earlier ones must not be used any more.
  ProgressFunction Next(double weight) {
    begun_ += weight;
    return [this, begin = begun_ - weight, weight](const Progress& part) {
      const double fraction =
          part.total > 0 ? std::clamp(part.done / part.total, 0.0, 1.0) : 0.0;
      return Report(whole_, std::min(begin + weight * fraction, total_), total_, part.note);
    };
  }

 private:
  ProgressFunction whole_;
  double total_, begun_ = 0;
};

}  // namespace regrade
