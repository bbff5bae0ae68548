// How long a stage will still take, from how fast it has been going lately.
#pragma once

#include <deque>
#include <optional>

namespace regrade {

// The rate is measured over a window that grows with the stage (its last third, at least 3 s),
// so that a slow start and a change of pace are forgotten, and single slow steps are not
// noticed.
class EtaEstimator {
 public:
  // `seconds` since the stage began, from a clock that never goes back; `done` of `total`.
  void Add(double seconds, double done, double total);
  // Seconds left; empty before 1 s, before anything is done, and without a total.
  std::optional<double> Remaining() const;

 private:
  struct Point {
    double seconds, done;
  };
  std::deque<Point> points_;
  double total_ = 0;
};

}  // namespace regrade
