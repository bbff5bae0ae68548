#include "pipeline/run/field_fit.h"

#include <cmath>

namespace regrade {

double RoundedForChart(double value) { return std::round(value * 1000) / 1000; }

}  // namespace regrade
