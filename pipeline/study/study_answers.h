// Reads the answers to a study and says what they show.
#pragma once

#include <string>
#include <vector>

#include "evaluate/preference.h"
#include "pipeline/files/json_file.h"

namespace regrade {

struct StudyAnswers {
  std::string study, question;
  std::vector<std::string> methods;
  std::vector<std::vector<Choice>> participants;  // who passed every check
  int failed = 0;                                 // participants who did not
  int unfinished = 0;  // of those counted: participants without all answers
};

// One file for each participant, as the page saves it. Errors (kInput, with the file): not such
// a file, a choice among films that were not shown, another study than the first file's, a
// participant given twice, or nobody left.
StudyAnswers ReadStudyAnswers(const std::vector<std::string>& paths);

// `methods` with `chosen`, `shown`, `share`, `share_low`, `share_high`, `strength`,
// `strength_low`, `strength_high`; `pairs` with `first`, `second`, `first_chosen`, `choices`,
// `share_low`, `share_high`, `sign_test`; `participants`, `failed_checks`, `unfinished`.
JsonValue AnalyseStudy(const StudyAnswers& answers);

// The same as a table for a terminal, with what it assumes.
std::string FormatStudy(const JsonValue& analysis);

}  // namespace regrade
