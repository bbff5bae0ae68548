// Commands that continue a run: its options hold unless flags override them.
#pragma once

#include <string>

#include "pipeline/commands/command.h"

namespace regrade {

// Opens the folder among `arguments` and runs the stages from `first` to the report, of one
// style of the folder: --name, or the last one that was finished. Takes the options of the
// style's run.json, overridden by flags.
void ContinueStyle(const Command& command, const Arguments& arguments, const std::string& first,
                   Console* console);

}  // namespace regrade
