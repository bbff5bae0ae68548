// The views that a style is trained on, and what is in memory of the field meanwhile.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

// `cameras`, evenly among them, as many as see few enough of the `splats` that these and the
// cameras' pictures fit into `memory` bytes while a style is trained; one at least. In their
// order.
std::vector<int> CamerasWithin(uint64_t memory, const RadianceField& splats,
                               const std::vector<Camera>& cameras);

struct TrainedField {
  StoredField stored;  // whole, or of a field that does not fit what `views` see
  std::vector<int> views;
  std::string notice;  // of what was left out; else empty
};

// Whether a style of a field with so many splats (0: of voxels) is trained on a part of it:
// where the whole does not fit into --max-memory. What is free decides nothing: the same
// command makes the same style. A style of an object, or with a residual, knows all splats.
bool IsTrainedOnAPart(const RunSettings& settings, int64_t splats);

// `geometry`: of ReadFieldGeometry. `views`: in the field's frame; `indices`: those with a
// picture.
TrainedField ReadTrainedField(const RunContext& context, StoredField geometry,
                              const WorkingViews& views, std::vector<int> indices);

}  // namespace regrade
