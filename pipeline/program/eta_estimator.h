// Estimates how long a stage will still take.
#pragma once

#include <deque>
#include <optional>

namespace regrade {

// The rate is measured over a window (a tenth of the work, at least 3 s): a slow start and a
// change of pace are forgotten, and single slow steps are averaged out. The rate since the
// start has a weight of a third. A first report of a small fraction of the work ends
// preparations, whose rate is ignored.
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
  Point start_{0, 0};  // the first report: a resumed stage does not begin at 0
  double total_ = 0;
};

}  // namespace regrade
