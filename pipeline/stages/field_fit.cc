#include "pipeline/stages/field_fit.h"

#include <cmath>

namespace regrade {

std::unique_ptr<FieldFit> MakeFieldFit(const RunSettings& settings, const FitPlace& place) {
  return settings.scene.UsesSplats() ? MakeSplatFit(settings, place)
                                     : MakeVoxelFit(settings, place);
}

double RoundedForChart(double value) { return std::round(value * 1000) / 1000; }

}  // namespace regrade
