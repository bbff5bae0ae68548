// Estimates the duration of measurements from rough rates, corrected by what has been measured.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "pipeline/tradeoff/measurements.h"

namespace regrade {

class DurationEstimate {
 public:
  DurationEstimate(const RunSettings& base, const std::vector<Measurement>& measured);

  void Add(const Measurement& measurement);
  double Seconds(const Variant& variant) const;

 private:
  struct Sum {
    double measured = 0, rough = 0;
  };
  double Rough(const Variant& variant) const;

  RunSettings base_;
  std::map<std::string, Sum> benchmarks_;  // measured and estimated seconds of the base
  std::map<std::string, double> last_;     // last measured seconds of each variant
};

}  // namespace regrade
