// Files of splats that other programs wrote, for runs and for the evaluator.
#pragma once

#include <string>

#include "kernels/field/radiance_field.h"
#include "pipeline/fields/splat_scene.h"
#include "pipeline/program/console.h"

namespace regrade {

// Of so many harmonics a channel.
int DegreeOf(int basis);

// Reads a file within `max_memory_gb`, of 10^9 bytes; 0: within what is free. Tells `console`
// what is in it, unless that is null. Throws Error(kInput) as ReadSplats.
SplatScene ReadForeignSplats(const std::string& path, double max_memory_gb, Console* console);

// In the file's own world, to place views in it.
RadianceField FieldInItsWorld(const SplatScene& scene);

}  // namespace regrade
