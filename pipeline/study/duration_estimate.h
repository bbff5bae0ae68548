// Estimates the duration of measurements from rough rates, corrected by what has been measured.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "pipeline/run/fit_kind.h"
#include "pipeline/study/measurements.h"

namespace regrade {

class DurationEstimate {
 public:
  // Of a fit with these settings: its photos and their pixels; small ones have less work.
  using FitPlaceFunction = std::function<FitPlace(const RunSettings&)>;
  DurationEstimate(const RunSettings& base, const std::vector<Measurement>& measured,
                   FitPlaceFunction place_of);

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
  FitPlaceFunction place_of_;
  std::map<std::string, Sum> benchmarks_;  // measured and estimated seconds of the base
  std::map<std::string, double> last_;     // last measured seconds of each variant
};

}  // namespace regrade
