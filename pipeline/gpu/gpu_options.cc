#include "pipeline/gpu/gpu_options.h"

#include "kernels/base/error.h"
#include "pipeline/run/resolve_settings.h"

namespace regrade {

bool GpuSettings::Bind(const std::string& command, OptionSet* options) {
  if (command == "fit") {
    options->Add("Capture", &fit_packed);
    options->Add("Fit", &fit);
  } else if (command == "splats") {
    options->Add("Capture", &fit_splats);
    options->Add("Fit", &splats);
  } else if (command == "style") {
    options->Add("Capture", &style_packed);
    options->Add("Network", &network);
  } else if (command == "render") {
    options->Add("Capture", &render_packed);
  } else {
    return false;
  }
  return true;
}

void ReadFlags(const std::vector<std::string>& arguments, OptionSet* options) {
  const std::vector<std::string> words = options->Parse(arguments);
  if (!words.empty())
    throw UsageError("unexpected argument", words[0], "options begin with two dashes");
  ResolveSettings({}, options);
}

}  // namespace regrade
