#include "pipeline/commands/command.h"

#include <omp.h>

#include <algorithm>
#include <cstdio>

#include "kernels/base/error.h"

namespace regrade {

bool PrintedHelp(const Command& command, const Arguments& arguments, const OptionSet& options) {
  const auto flags_end = std::find(arguments.begin(), arguments.end(), "--");
  const auto asks = [](const std::string& word) { return word == "--help" || word == "-h"; };
  if (std::none_of(arguments.begin(), flags_end, asks)) return false;
  std::printf("regrade %s %s\n%s\n%s", command.name, command.usage, command.summary,
              options.Help().c_str());
  return true;
}

void CheckWords(const Command& command, const Arguments& words, size_t least, size_t most) {
  if (words.size() >= least && words.size() <= most) return;
  throw Error(ExitCode::kUsage,
              words.size() < least ? "an argument is missing"
                                   : "one argument too many: '" + words[most] + "'",
              std::string("regrade ") + command.name,
              std::string("usage: regrade ") + command.name + " " + command.usage);
}

void ApplyProgramOptions(const ProgramOptions& options) {
  if (options.threads > 0) omp_set_num_threads(options.threads);
}

}  // namespace regrade
