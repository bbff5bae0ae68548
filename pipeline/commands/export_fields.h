// `regrade export` of the scene and its styles as fields of splats or voxels, or as points.
#pragma once

#include <string>

#include "pipeline/commands/export_options.h"
#include "pipeline/program/console.h"

namespace regrade {

// Writes field.EXT and NAME.EXT for each style. Throws Error(kUsage) for a format that does not
// suit the field, and where --out is not empty; Error(kInput) for a folder without a field and
// styles that are not finished; Error(kResources).
void ExportFields(const ExportOptions& options, const std::string& folder, Console* console);

// Makes --out, a new or empty folder, and the folder `inside` it, if that is not empty.
void MakeEmptyFolder(const std::string& folder, const std::string& inside);

}  // namespace regrade
