// How a long loop reports where it is and learns whether to go on.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

namespace regrade {

enum class LoopControl {
  kContinue,
  kStop,  // save a checkpoint and leave: the loop throws Interrupted
};

struct Progress {
  double done = 0.0;  // same unit as total; total <= 0 means unknown
  double total = 0.0;
  std::string note;  // one short clause for the progress line, e.g. "24.1 dB on training rays"
};

// Called often (every step); cheap when there is nothing to print.
using ProgressFunction = std::function<LoopControl(const Progress&)>;

inline LoopControl Report(const ProgressFunction& progress, double done, double total,
                          const std::string& note = "") {
  return progress ? progress({done, total, note}) : LoopControl::kContinue;
}

// One progress for work in several parts, each of which reports its own from 0 to its total.
// `whole` is told the weights of the parts before plus the share of the present one, so that
// the time left is that of all.
class ProgressParts {
 public:
  // total_weight: the sum of the weights that Next will be called with; seconds make good
  // weights.
  ProgressParts(ProgressFunction whole, double total_weight)
      : whole_(std::move(whole)), total_(total_weight) {}

  // The progress function of the next part; those handed out before must not be used any more.
  ProgressFunction Next(double weight) {
    begun_ += weight;
    return [this, begin = begun_ - weight, weight](const Progress& part) {
      const double share = part.total > 0 ? std::clamp(part.done / part.total, 0.0, 1.0) : 0.0;
      return Report(whole_, std::min(begin + weight * share, total_), total_, part.note);
    };
  }

 private:
  ProgressFunction whole_;
  double total_, begun_ = 0;
};

}  // namespace regrade
