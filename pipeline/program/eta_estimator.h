// How long a stage will still take, from how fast it has been going lately.
#pragma once

#include <deque>
#include <optional>

namespace regrade {

// The rate is measured over a window (a tenth of the work, at least 3 s), so that a slow start
// and a change of pace are forgotten, and single slow steps are not noticed; the pace since the
// start has a third of the say. A first report of a small share of the work ends preparations,
// which say nothing of the pace.
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
  Point start_{0, 0};  // the first that was told: a resumed stage does not begin at 0
  double total_ = 0;
};

}  // namespace regrade
