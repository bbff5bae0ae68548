// Estimates the duration of measurements from rough rates, corrected by what has been measured.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "pipeline/tradeoff/measurements.h"

namespace regrade {

class DurationEstimate {
 public:
  // `pixels_of`: of the photos that a fit with these settings has, at working size; small ones
  // have fewer stages.
  using FittedPixelsFunction = std::function<int64_t(const RunSettings&)>;
  DurationEstimate(const RunSettings& base, const std::vector<Measurement>& measured,
                   FittedPixelsFunction pixels_of);

  void Add(const Measurement& measurement);
  double Seconds(const Variant& variant) const;

  // Of the base run from poses on, of that many photos, before anything was measured: fit and,
  // with a style, training, frames, films and metrics. Roughly, on two cores.
  double BaseSeconds(int64_t photos, bool style) const;

 private:
  struct Sum {
    double measured = 0, rough = 0;
  };
  double Rough(const Variant& variant) const;

  RunSettings base_;
  FittedPixelsFunction pixels_of_;
  std::map<std::string, Sum> benchmarks_;  // measured and estimated seconds of the base
  std::map<std::string, double> last_;     // last measured seconds of each variant
};

}  // namespace regrade
