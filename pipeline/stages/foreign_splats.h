// The file of splats that a run was given in place of photos.
#pragma once

#include <string>

#include "kernels/field/radiance_field.h"
#include "pipeline/run/run_context.h"
#include "pipeline/splat_files/splat_scene.h"

namespace regrade {

// Of so many harmonics a channel.
int DegreeOf(int basis);

// Reads the run's file, within --max-memory. `say`: tells the console what is in it, which one
// stage of a run does. Throws Error(kInput) as ReadSplats.
SplatScene ReadForeignSplats(const RunContext& context, bool say);

// In the file's own world, to place views in it.
RadianceField FieldInItsWorld(const SplatScene& scene);

}  // namespace regrade
