// What becomes of --require at the end: messages, events, a JUnit file, and the exit status.
#pragma once

#include <string>
#include <vector>

#include "pipeline/program/console.h"
#include "pipeline/report/requirements.h"

namespace regrade {

// JUnit XML: a test case for each requirement, of the class "regrade" or "regrade.STYLE"; where
// it does not hold, a failure with measured value and bound.
std::string JUnitXml(const std::vector<CheckedRequirement>& requirements);

// Before work: removes the file of an earlier start, which would otherwise pass for this one's
// if it fails. Nothing for an empty path. Throws Error(kInput) if there is no such folder, or
// the path is a folder.
void BeginJUnit(const std::string& path);

// Prints each requirement that holds, sends the event "requirement" for every one, and writes
// the file, unless `junit` is empty. Then throws Error(kRequirement) with a sentence for each
// that does not hold, unless all do.
void FinishRequirements(const std::vector<CheckedRequirement>& requirements,
                        const std::string& junit, Console* console);

}  // namespace regrade
