// Commands that continue a run: its options hold unless flags override them.
#pragma once

#include <string>

#include "pipeline/commands/command.h"

namespace regrade {

// Opens the folder among `arguments`, takes the options of its run.json, overridden by flags,
// and runs the stages from `first` to the report.
void ContinueRun(const Command& command, const Arguments& arguments, const std::string& first,
                 Console* console);

}  // namespace regrade
