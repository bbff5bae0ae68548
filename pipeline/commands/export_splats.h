// `regrade export` of a field of splats in the formats of viewers, editors and engines.
#pragma once

#include <string>

#include "pipeline/commands/export_options.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/program/console.h"

namespace regrade {

// Whether a --format is one of splats.
bool IsSplatExport(const std::string& format);

// Writes OUT/`name`.EXT, and says how large it is and what it loses: the file is read again and
// rendered for some views of `folder`. Throws Error(kUsage) where a format cannot hold it,
// Error(kResources).
void ExportSplats(const ExportOptions& options, const std::string& folder,
                  const std::string& name, const StoredField& stored, Console* console);

// Writes OUT/cameras.json, the photos' cameras in their world (right, down, front), and
// OUT/transform.json, which leads from the files' axes to that world.
void WriteCamerasAndTransform(const ExportOptions& options, const std::string& folder);

}  // namespace regrade
