// Estimates how long a stage will still take.
#pragma once

#include <deque>
#include <optional>

namespace regrade {

// The rate is measured over a window (a tenth of the work, at least 3 s): a slow start and a
// change of pace are forgotten, and single slow steps are averaged out. The rate since the
// start has a weight of a third. A first report of a small fraction of the work ends
// preparations, whose rate is ignored.
// Seconds left of a whole command: `left` of the current stage and what follows it. Expected
// seconds are rough, so they are multiplied by the pace so far: what finished stages and the
// current one take of what was expected of them. The pace counts as little as the part of the
// work that it was measured on.
struct ExpectedTime {
  double finished = 0, current = 0, later = 0;  // expected seconds of stages
};
double LeftInAll(const ExpectedTime& expected, double spent_on_finished,
                 double spent_on_current, double left);

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
