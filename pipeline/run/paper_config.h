// The four configurations of Plenoxels' published code (svox2), for --preset paper.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/program/console.h"
#include "pipeline/program/run_options.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

inline constexpr const char* kPaperConfigs[] = {"syn", "llff", "tnt", "custom"};
// What --preset paper sets before the capture is known.
inline constexpr char kPaperBase[] = "custom";
inline constexpr char kPaperConfig[] = "paper-config";  // the option

// Sets everything that a configuration decides: field, box, effects and size of the photos.
// Throws Error(kUsage) for a name that is not in kPaperConfigs.
void UsePaperConfig(const std::string& name, RunSettings* settings);

// {"name": value} of what a configuration decides: as the settings have it, and as published.
JsonValue DecidedValues(const RunSettings& settings);
JsonValue PaperValues(const std::string& name);

// {"name": value} of what LipRF's recipe and its protocol decide, the same for all of them.
JsonValue RecipeValues(const RunSettings& settings);
JsonValue ProtocolValues(const RunSettings& settings);

// What the choice depends on.
struct PaperTraits {
  bool transparent = false, forward_facing = false;
};

struct PaperChoice {
  std::string name, reason;
};

// svox2 chooses none by itself; auto is ours. Throws Error(kUsage), with the remedy, for syn
// without transparent photos and for llff without a forward-facing capture.
PaperChoice ChoosePaperConfig(const std::string& asked, const PaperTraits& traits);

// Throws Error(kUsage) for a configuration without --preset paper.
void CheckPaper(const std::string& preset, const std::string& config);

// Sets the options, bound after --preset paper, to the choice. An option stays where a flag set
// it, or where its value is not the base's: it was asked for.
void ApplyPaperChoice(const PaperChoice& choice, OptionSet* options);

// "fit-rays is 64, published 5000" for each of `values` that is not the configuration's, the
// recipe's or the protocol's.
std::vector<std::string> NotToTheLetter(const std::string& name, const JsonValue& values);

// Of the recipe's or the protocol's values, where the preset is that of the paper; said on the
// console, too. Empty with another preset.
std::optional<std::vector<std::string>> SayIfPaper(const RunSettings& settings,
                                                   const JsonValue& values, Console* console);

}  // namespace regrade
