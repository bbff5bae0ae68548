// `regrade export` of a style as a LUT.
#pragma once

#include <string>

#include "pipeline/commands/export_options.h"
#include "pipeline/program/console.h"

namespace regrade {

// Writes one map of colours to the file --out, and says what that loses. Of a retouch that is
// such a map it is that map; of others it is fitted to renders before and after. Throws
// Error(kUsage) for several names, Error(kInput), Error(kResources).
void ExportLut(const ExportOptions& options, const std::string& folder, Console* console);

}  // namespace regrade
