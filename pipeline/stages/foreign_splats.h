// The file of splats that a run was given in place of photos.
#pragma once

#include <string>

#include "kernels/field/radiance_field.h"
#include "pipeline/run/run_context.h"
#include "pipeline/splat_files/splat_scene.h"

namespace regrade {

// Reads the run's file, within --max-memory. `say`: for
// the console, once a run. Throws Error(kInput) as ReadSplats.
SplatScene ReadForeignSplats(const RunContext& context, bool say);

// In the file's own world, to place views in it.
RadianceField FieldInItsWorld(const SplatScene& scene);

}  // namespace regrade
