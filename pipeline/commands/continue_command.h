// Commands over a folder in which a run has worked: its options hold until they are overridden.
#pragma once

#include <string>

#include "pipeline/commands/command.h"

namespace regrade {

// Opens `folder`, takes the options of its run.json, lets the flags override
// them, and does the stages from `first` to the report.
void ContinueRun(const Command& command, const Arguments& arguments, const std::string& first,
                 Console* console);

}  // namespace regrade
