// What every stage is given: the settings, the output folder, and who to talk to.
#pragma once

#include <string>

#include "kernels/scene/capture.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

struct RunContext {
  RunSettings settings;
  OptionSet options;   // bound to `settings`
  std::string source;  // PHOTOS or CAPTURE, absolute; empty where a command takes none
  Workspace* workspace = nullptr;
  Console* console = nullptr;

  // What a finished stage has made, as an input of later ones; null before it is done.
  JsonValue ResultOf(const std::string& stage) const {
    const auto record = workspace->Find(stage);
    return record ? JsonValue(record->OutputHash()) : JsonValue();
  }
};

}  // namespace regrade
