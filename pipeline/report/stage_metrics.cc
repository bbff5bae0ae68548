#include "pipeline/report/stage_metrics.h"

#include <cmath>

namespace regrade {
namespace {

std::string Percent(double fraction) {
  return std::to_string(std::lround(100 * fraction)) + " %";
}

}  // namespace

std::string SeenByFewMetrics::Sentence() const {
  if (!film.value) return "";
  std::string text =
      "seen by fewer than three photos: " + Percent(*film.value) + " of the film";
  if (worst_frame.value)
    text += " (" + Percent(*worst_frame.value) + " of frame " +
            std::to_string(worst_frame_number) + ")";
  return text;
}

}  // namespace regrade
