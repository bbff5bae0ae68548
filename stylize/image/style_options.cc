#include "stylize/image/style_options.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

struct NamedKind {
  const char* name;
  StyleMethodKind kind;
};
constexpr NamedKind kColorMethods[] = {{"mkl", StyleMethodKind::kMkl},
                                       {"gmm", StyleMethodKind::kGmm},
                                       {"reinhard", StyleMethodKind::kReinhard}};
constexpr NamedKind kNetworks[] = {{"pca-kd", StyleMethodKind::kNetwork}};
constexpr NamedKind kMethodsWithArgument[] = {{"onnx", StyleMethodKind::kOnnx},
                                              {"folder", StyleMethodKind::kFolder},
                                              {"command", StyleMethodKind::kCommand}};

}  // namespace

StyleMethod ParseStyleMethod(const StyleOptions& options) {
  const std::string& text = options.method;
  const std::string hint = std::string("use ") + kStyleMethods;
  for (const auto& [name, kind] : kColorMethods)
    if (text == name) return {kind, name, ""};
  const auto refuse_scene_wide = [&](const std::string& name) {
    if (options.scene_wide)
      throw UsageError(
          "\"" + name + "\" styles each view by itself", "--method and --scene-wide",
          "leave it out, or add --no-scene-wide where an earlier run asked for it");
  };
  for (const auto& [name, kind] : kNetworks) {
    if (text != name) continue;
    refuse_scene_wide(name);
    return {kind, name, ""};
  }
  for (const auto& [name, kind] : kMethodsWithArgument) {
    const std::string prefix = std::string(name) + ":";
    if (!text.starts_with(prefix)) continue;
    const std::string argument = text.substr(prefix.size());
    if (argument.find_first_not_of(" \t") == std::string::npos)
      throw UsageError("nothing follows \"" + prefix + "\"", "--method", hint);
    refuse_scene_wide(name);
    return {kind, name, argument};
  }
  throw UsageError("there is no 2D method \"" + text + "\"", "--method", hint);
}

}  // namespace regrade
