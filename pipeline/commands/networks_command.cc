// regrade networks: lists and removes what was fetched for methods that are named.
#include <cstdio>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/program/known_networks.h"

namespace regrade {

void RunNetworks(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  OptionSet options;
  options.Add("Program", &program);
  const auto prepared =
      Prepare(command, arguments, {.least_words = 1, .most_words = 2}, &options);
  if (!prepared) return;
  const std::string& what = prepared->words[0];
  CheckWords(command, prepared->words, what == "remove" ? 2 : 1, what == "remove" ? 2 : 1);
  if (what == "remove") {
    const KnownNetwork& network = FindNetwork(prepared->words[1]);
    console->Info(RemoveNetwork(network) ? "removed " + NetworkFolder(network.name)
                                         : network.name + " is not on this machine");
    return;
  }
  if (what != "list") throw UsageError("is neither list nor remove", what);
  for (const KnownNetwork& network : KnownNetworks()) {
    const bool here = HasNetwork(network);
    const std::string place = NetworkFolder(network.name);
    console->Event("network", JsonValue::Object{{"name", network.name},
                                                {"summary", network.summary},
                                                {"folder", place},
                                                {"here", here}});
    if (!program.json)
      std::printf(
          "%-8s %s - %s\n", network.name.c_str(), network.summary.c_str(),
          here ? Printable(place).c_str()
               : ("not on this machine; --method " + network.name + " fetches it").c_str());
  }
}

}  // namespace regrade
