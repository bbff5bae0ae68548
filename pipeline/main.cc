// Entry point: runs the command, and turns its exceptions into a message and an exit code.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/images/decoder_message.h"
#include "pipeline/images/decoder_process.h"
#include "pipeline/images/decoder_server.h"
#include "pipeline/program/console.h"
#include "pipeline/program/crash_probe.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/program/nearest_name.h"
#include "pipeline/stages/network_probe.h"

namespace regrade {
namespace {

void PrintHelp() {
  std::printf(
      "regrade " REGRADE_VERSION
      ": photographs in, a styled 3D scene out\n\nusage: regrade COMMAND [OPTIONS]\n\n");
  for (const Command& command : AllCommands())
    std::printf("  %-14s %s\n", command.name, command.summary);
  std::printf(
      "\nthe usual way:\n"
      "  regrade run PHOTOS --style PICTURE --out DIR      photos to film and report\n"
      "  regrade stylize DIR --style OTHER_PICTURE         another style of the same scene\n"
      "\nregrade COMMAND --help has the usual options of a command, --help-all has all, "
      "--help-constants what only measurements change.\n");
}

void Dispatch(const Arguments& arguments, Console* console) {
  const std::string name = arguments.empty() ? "help" : arguments[0];
  if (name == "help" || name == "--help" || name == "-h") return PrintHelp();
  if (name == "--version" || name == "version") {
    std::printf("regrade " REGRADE_VERSION "\n");
    return;
  }
  if (name == kProbeFlag)
    return RunNetworkProbe(Arguments(arguments.begin() + 1, arguments.end()));
  if (name == kDecoderFlag) ServeDecoding();
  DecodeApart({.command = {"/proc/self/exe", kDecoderFlag}});
  std::vector<std::string> names = {"help"};
  for (const Command& command : AllCommands()) {
    if (name == command.name)
      return command.run(command, Arguments(arguments.begin() + 1, arguments.end()), console);
    names.push_back(command.name);
  }
  const std::string nearest = NearestName(name, names);
  throw UsageError(
      "unknown command", name,
      nearest.empty() ? "see `regrade help`" : "did you mean `regrade " + nearest + "`?");
}

// Memory may end in a thread of a parallel region, from which no exception leads out.
[[noreturn]] void EndWithoutMemory() {
  try {
    if (const std::exception_ptr error = std::current_exception())
      std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    constexpr char kMessage[] =
        "regrade: out of memory. To do: close other programs, or use --preset draft\n";
    [[maybe_unused]] const ssize_t written =
        ::write(STDERR_FILENO, kMessage, sizeof kMessage - 1);
    ::_exit(static_cast<int>(ExitCode::kResources));
  } catch (...) {
  }
  std::abort();
}

int Run(const Arguments& arguments) {
  const auto flags_end = std::ranges::find(arguments, "--");
  Console console(std::find(arguments.begin(), flags_end, "--json") != flags_end);
  console.SetVerbose(std::find(arguments.begin(), flags_end, "--verbose") != flags_end);
  ExitCode code = ExitCode::kBug;
  try {
    Dispatch(arguments, &console);
    std::fflush(stdout);
    return static_cast<int>(ExitCode::kDone);
  } catch (const Error& error) {
    console.Fail(error);
    code = error.code();
  } catch (const Interrupted&) {
    console.Info("stopped; finished work is kept, and the same command continues from there");
    DieBySignal(StopSignal());
  } catch (const std::bad_alloc&) {
    code = ExitCode::kResources;
    console.Fail("out of memory. To do: close other programs, or use --preset draft", code);
  } catch (const std::system_error& error) {  // of files and folders, too
    code = ExitCode::kResources;
    console.Fail(std::string(error.what()) +
                     ". To do: check the folder, its disk, and the limits on open files and "
                     "threads, then run the same command again",
                 code);
  } catch (const std::exception& error) {
    console.Fail(std::string("internal error: ") + error.what() +
                     ". To do: please report it with the command and this line",
                 code);
  }
  return static_cast<int>(code);
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  regrade::InstallSignalHandling();
  std::set_terminate(regrade::EndWithoutMemory);
  return regrade::Run(regrade::Arguments(argv + std::min(argc, 1), argv + argc));
}
