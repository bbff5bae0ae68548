#include "stylize/image/style_options.h"

#include "kernels/base/error.h"

namespace regrade {

StyleMethod ParseStyleMethod(const StyleOptions& options) {
  const std::string& text = options.method;
  const std::string hint = std::string("use ") + kStyleMethods;
  if (options.regrain && text != "idt" && text != "histogram")
    throw Error(ExitCode::kUsage, "\"" + text + "\" makes no grain louder",
                "--method and --style-regrain",
                "leave it away, or add --no-style-regrain where an earlier run asked for it");
  for (const char* kind : {"mkl", "reinhard", "idt", "histogram"})
    if (text == kind) return {kind, ""};
  for (const char* kind : {"onnx", "folder", "command"}) {
    const std::string prefix = std::string(kind) + ":";
    if (!text.starts_with(prefix)) continue;
    const std::string argument = text.substr(prefix.size());
    if (argument.find_first_not_of(" \t") == std::string::npos)
      throw Error(ExitCode::kUsage, "nothing follows \"" + prefix + "\"", "--method", hint);
    if (options.scene_wide)
      throw Error(ExitCode::kUsage, "\"" + std::string(kind) + "\" styles each view by itself",
                  "--method and --scene-wide",
                  "leave it away, or add --no-scene-wide where an earlier run asked for it");
    return {kind, argument};
  }
  throw Error(ExitCode::kUsage, "there is no 2D method \"" + text + "\"", "--method", hint);
}

}  // namespace regrade
