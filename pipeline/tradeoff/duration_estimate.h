// How long a measurement will take: from rough rates at first, and from what has been measured
// as soon as there is something.
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
    double took = 0, rough = 0;
  };
  double Rough(const Variant& variant) const;

  RunSettings base_;
  std::map<std::string, Sum> planes_;   // what rough rates are off by
  std::map<std::string, double> last_;  // seconds of a variant when it was measured
};

}  // namespace regrade
