// How well a scene's field shows the photos.
#pragma once

#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/program/console.h"
#include "pipeline/report/stage_metrics.h"

namespace regrade {

// Measures the field that was written on held-out and some other photos; says how sharp it is.
// Renders are not compared with the field that they are of. `given`: the field was not fitted
// here, and nobody knows to which photos.
void MeasureFit(const WorkingViews& views, const StoredField& stored, Backend backend,
                bool given, Console* console, ReconstructReport* metrics);

}  // namespace regrade
