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
  StylePackedOptions style_packed;
  TrainNetworkOptions network;
  RenderPackedOptions render_packed;

  // Adds the options of "fit", "style" or "render"; false for another command.
  bool Bind(const std::string& command, OptionSet* options);
};

// Reads what stands behind the command, in the precedence of a run: defaults, --recipe, other
// flags. Throws Error(kUsage), also for words that are no flag.
void ReadFlags(const std::vector<std::string>& arguments, OptionSet* options,
               GpuSettings* settings);

}  // namespace regrade
