// regrade manual: the man page and bash's completion, written from the tables of commands and
// options.
#include <cstdio>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"

namespace regrade {
namespace {

void PrintManPage(Console* console) {
  std::printf(".TH REGRADE 1 \"\" \"regrade " REGRADE_VERSION
              "\"\n.SH NAME\nregrade \\- photographs in, a styled 3D scene out\n.SH SYNOPSIS\n"
              ".B regrade\n.I COMMAND\n[\\fIOPTIONS\\fR]\n.SH COMMANDS\n");
  for (const Command& command : AllCommands())
    std::printf(".TP\n.B %s\n\\&%s\n", command.name, command.summary);
  for (const Command& command : AllCommands()) {
    std::printf(".SH \"regrade %s\"\n\\&%s\n", command.name, command.summary);
    std::fflush(stdout);
    command.run(command, {kHelpMan}, console);
  }
  std::printf(
      ".SH EXIT STATUS\n0 done, 1 internal error, 2 usage, 3 input data, 4 an external "
      "program, "
      "5 resources, 6 the scene cannot be reconstructed, 7 the output folder is in use, "
      "8 a metric of \\-\\-require is missing or out of its bound, 128 + n ended by signal "
      "n.\n");
}

// Options of a command behind it, choices behind an option, and file names everywhere.
void PrintCompletion(Console* console) {
  std::printf("# bash completion for regrade\n_regrade_words() {\n  case \"$1\" in\n");
  for (const Command& command : AllCommands()) {
    std::printf("    %s) cat <<'END'\n", command.name);
    command.run(command, {kHelpWords}, console);
    std::printf("END\n      ;;\n");
  }
  std::printf("  esac\n}\n_regrade() {\n  local word=${COMP_WORDS[COMP_CWORD]} words\n");
  std::printf("  if [[ $COMP_CWORD -eq 1 ]]; then\n    words=\"");
  for (const Command& command : AllCommands()) std::printf("%s ", command.name);
  std::printf(
      "help\"\n"
      "  elif [[ $word == -* ]]; then\n"
      "    words=$(_regrade_words \"${COMP_WORDS[1]}\" | cut -d' ' -f1)\n"
      "  else\n"
      "    words=$(_regrade_words \"${COMP_WORDS[1]}\" |\n"
      "            grep -e \"^${COMP_WORDS[COMP_CWORD-1]} \" | cut -d' ' -f2-)\n"
      "  fi\n"
      "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
      "}\n"
      "complete -o default -F _regrade regrade\n");
}

}  // namespace

void RunManual(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  OptionSet options;
  options.Add("Program", &program);
  const auto prepared = Prepare(command, arguments, {.least_words = 0}, &options);
  if (!prepared) return;
  if (prepared->words.empty()) return PrintManPage(console);
  if (prepared->words[0] != "bash")
    throw UsageError("'" + prepared->words[0] + "' is no shell", "regrade manual",
                     "use regrade manual bash");
  PrintCompletion(console);
}

}  // namespace regrade
