#include "pipeline/program/eta_estimator.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr double kWindowFraction = 0.1;  // of the work
constexpr double kShortestWindow = 3;    // seconds
constexpr size_t kMostPoints = 512;
constexpr double kSmallFirstFraction = 0.02;  // of the work: before it were preparations

}  // namespace

double LeftInAll(const ExpectedTime& expected, double spent_on_finished,
                 double spent_on_current, double left) {
  constexpr double kTrust = 0.5;  // in what was expected, as a part of all of it
  const double seen = expected.finished + expected.current, all = seen + expected.later;
  if (!(all > 0)) return left;
  const double pace =
      (spent_on_finished + spent_on_current + left + kTrust * all) / (seen + kTrust * all);
  return left + pace * expected.later;
}

void EtaEstimator::Add(double seconds, double done, double total) {
  total_ = total;
  if (points_.empty()) {
    start_ = {seconds, done};
    if (done < total * kSmallFirstFraction) {
      points_.push_back(start_);
      return;
    }
    points_.push_back({0, 0});
  }
  if (done < points_.back().done) {  // restarted (a finer grid): the old rate is obsolete
    points_.assign(1, {seconds, done});
    start_ = points_.front();
    return;
  }
  points_.push_back({seconds, done});
  while (points_.size() > 2 && points_[1].seconds <= seconds - kShortestWindow &&
         points_[1].done <= done - total * kWindowFraction)
    points_.pop_front();
  if (points_.size() > kMostPoints) {  // keep the ends and every other point between
    std::deque<Point> thinned;
    for (size_t i = 0; i < points_.size(); ++i)
      if (i % 2 == 0 || i + 1 == points_.size()) thinned.push_back(points_[i]);
    points_.swap(thinned);
  }
}

std::optional<double> EtaEstimator::Remaining() const {
  if (points_.size() < 2 || !(total_ > 0)) return std::nullopt;
  const Point &first = points_.front(), &last = points_.back();
  if (last.seconds < 1 || !(last.done > first.done) || !(last.seconds > first.seconds))
    return std::nullopt;
  double rate = (last.done - first.done) / (last.seconds - first.seconds);
  // Where units of work differ in cost, the recent rate and the mean rate err to opposite
  // sides; a slow start must still be forgotten.
  constexpr double kShareOfAll = 0.35;
  if (last.seconds > start_.seconds && last.done > start_.done)
    rate *= std::pow((last.done - start_.done) / (last.seconds - start_.seconds) / rate,
                     kShareOfAll);
  return std::max(0.0, (total_ - last.done) / rate);
}

}  // namespace regrade
