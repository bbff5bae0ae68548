// Asks the person at the terminal.
#pragma once

#include <string>

namespace regrade {

// Is there a terminal to ask on and to answer from?
bool CanAsk();

// "QUESTION [y/N]" on stderr; true for a yes. No answer is a no.
bool AnsweredYes(const std::string& question);

}  // namespace regrade
