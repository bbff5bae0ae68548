// The subcommands' options of regrade_gpu, read from its command line.
#pragma once

#include <string>
#include <vector>

#include "pipeline/gpu/gpu_commands.h"
#include "pipeline/program/option_binding.h"

namespace regrade {

struct GpuSettings {
  FitPackedOptions fit_packed;
  FitOptions fit;
  FitSplatsOptions fit_splats;
  SplatFitOptions splats;
  StylePackedOptions style_packed;
  TrainNetworkOptions network;
  RenderPackedOptions render_packed;

  // Adds the options of "fit", "splats", "style" or "render"; false for another command.
  bool Bind(const std::string& command, OptionSet* options);
};

// Reads the arguments behind the command into the options that are bound; see ResolveSettings.
// Throws Error(kUsage), also for words that are no flag.
void ReadFlags(const std::vector<std::string>& arguments, OptionSet* options);

}  // namespace regrade
