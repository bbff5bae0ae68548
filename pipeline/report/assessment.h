// How a run went, in words, and what to do about what is weakest.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/data.h"

namespace regrade {

struct Assessment {
  // "sharp: 71 % of the photos' detail", "steady: the film is 1.0 dB steadier than frame by
  // frame", "faithful: 33.9 dB to the recoloured views, close". One that was not measured has
  // its reason.
  std::vector<std::string> sentences;
  std::string advice;  // about the weakest

  std::string Line() const;  // the sentences, joined
};

// Photos that took no part in the fit are far worse than fitted ones: what is missing is
// photos, and no finer field makes up for them.
bool LacksPhotos(const ReconstructReport& fit);

Assessment AssessmentOf(const RunReport& report);

}  // namespace regrade
