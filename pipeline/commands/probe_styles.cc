#include "pipeline/commands/probe_styles.h"

#include <filesystem>
#include <utility>

#include "evaluate/pair_motion.h"
#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/network_probe.h"

namespace regrade {
namespace {

// Of files:DIR, or nothing.
std::string FlowFolderOf(const std::string& flow) {
  const std::string prefix = kFlowFiles;
  return flow.starts_with(prefix) ? flow.substr(prefix.size()) : "";
}

}  // namespace

void CheckStyle(const std::string& path, const RunSettings& settings) {
  if (IsCubeFile(path)) {
    if (settings.style_2d.method != StyleOptions().method)
      throw UsageError("a LUT is its own method", "--method and --style " + path,
                       "leave --method out, or give --method " + StyleOptions().method +
                           " where an earlier run asked for another");
    if (!settings.object.style_mask.empty())
      throw UsageError("a LUT has no regions", "--style-mask and --style " + path,
                       "leave --style-mask out");
  }
  StyleExample(path, nullptr);
}

void ProbeStyles(RunSettings* settings, Console* console, bool measured) {
  RequireValue(settings->style.picture(), "--style", "name the style picture");
  for (std::string& picture : settings->style.pictures) {
    RequireValue(picture, "--style", "name the style picture");
    picture = AbsolutePath(picture);
    CheckStyle(picture, *settings);
    if (!IsCubeFile(picture)) continue;
    if (const ColorLut lut = ReadCubeFile(picture); lut.Slope() > kHarmlessSlope)
      console->Warn(picture + ": " + SlopeText(lut));
  }
  CheckMatch(*settings);
  MatchChoice& match = settings->style.match;
  if (const std::string network = match.Network(); !network.empty()) {
    match.SetNetwork(AbsolutePath(network));
    ProbeFeatureNetwork(match.Network());
  }
  const StartOptions& start = settings->start;
  ProbeMethod(&settings->style_2d,
              start.dry_run ? NetworkAccess() : AccessAfterYes(start.yes, console));
  ProbeMasks(&settings->object);
  const bool measures = measured && (start.until == "evaluate" || start.until == "report");
  if (measures) ProbeEvaluationNetworks(settings->consistency);
  for (const auto& [folder, option] :
       {std::pair{settings->residual.Layers(), "--residual layers:"},
        {measures ? FlowFolderOf(settings->consistency.flow) : "", "--flow files:"}})
    if (!folder.empty() && !std::filesystem::is_directory(folder))
      throw InputError("there is no such folder", folder, std::string("correct ") + option);
}

}  // namespace regrade
