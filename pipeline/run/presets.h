// The presets: how much time a run may take, and what it gives for it.
#pragma once

#include <string>

#include "pipeline/run/run_settings.h"

namespace regrade {

inline constexpr const char* kPresets[] = {"smoke", "draft", "standard", "paper", "best"};
bool IsPreset(const std::string& name);

// Changes default settings to those of a preset on a kind of processor; see PrefersCard. The
// values are a fixed table, never from a clock, so that a run repeats itself. Throws
// Error(kUsage) for a name that is not in kPresets.
void ApplyPreset(const std::string& preset, bool on_card, RunSettings* settings);

}  // namespace regrade
