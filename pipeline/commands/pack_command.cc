// regrade pack: writes a posed capture as one file, for `regrade_gpu` on bare GPU machines.
#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/capture/packed_capture.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/paper_traits.h"
#include "pipeline/run/run_settings.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

// A style picture is needed for its colours only.
constexpr int kStyleSide = 512;

Image SmallPicture(const std::string& path) {
  RefuseOtherLooks(path);
  if (IsCubeFile(path))
    throw InputError("is a LUT, and a packed capture holds a style picture", path,
                     "style the capture here: regrade stylize");
  const Image picture = ReadStylePicture(path, nullptr);
  const double scale =
      std::min(1.0, static_cast<double>(kStyleSide) / std::max(picture.width, picture.height));
  return Colors(Resize(picture, std::max(1, static_cast<int>(picture.width * scale)),
                       std::max(1, static_cast<int>(picture.height * scale))));
}

}  // namespace

void RunPack(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  RunOptions run;
  SceneOptions scene;
  StyleSource style;
  OptionSet options;
  options.Add("Run", &run);
  options.Add("Scene", &scene);
  options.Add("Style", &style);
  options.Add("Program", &program);
  const auto prepared = Prepare(command, arguments, {}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  RequireValue(run.out, "--out", "name the .npz file to write");
  const Capture capture = ReadPosedCapture(folder);
  if (run.preset == "paper") {
    const PaperChoice choice = ChoosePaperConfig(run.paper_config, TraitsOf(capture));
    ApplyPaperChoice(choice, &options);
    console->Info("configuration of the paper: " + choice.name + ", " + choice.reason);
  }
  const WorkingViews as_taken(capture, scene.photo_size, run.holdout);
  for (int i = 0; i < as_taken.count(); ++i)
    if (!as_taken.Mask(i).empty())
      throw InputError("was posed with --photo-masks, which a packed capture cannot hold",
                       folder, "pose it again without them");
  const SceneProfile profile = ProfileScene(capture, 2, run.effects, scene.box, scene.Kind());
  for (const EffectReport& effect : profile.effects) console->Info(EffectLine(effect));
  for (const std::string& notice : profile.notices) console->Info(notice);
  PackedCapture packed;
  if (style.match.On())
    throw UsageError("a packed capture holds one style picture", "--match", "leave it out");
  if (!style.pictures.empty()) packed.style = SmallPicture(style.picture());
  packed.scene = profile.scene;
  JsonValue decided = OptionValues(scene);
  decided["effects"] = run.effects;
  packed.decided = DumpJson(decided, -1);
  const WorkingViews views = as_taken.WithGains(profile.gains)
                                 .InField(packed.scene.field_from_world, packed.scene.ndc);
  const std::vector<bool> held_out = HeldOutViews(capture, run.holdout);
  for (int i = 0; i < views.count(); ++i)
    packed.views.push_back({views.View(i).file, held_out[static_cast<size_t>(i)],
                            views.CameraOf(i), views.Photo(i)});
  std::vector<int> fitted;
  for (int i = 0; i < views.count(); ++i)
    if (!packed.views[static_cast<size_t>(i)].held_out) fitted.push_back(i);
  std::vector<std::string> depth_notes;
  std::vector<std::vector<SeenPoint>> seen =
      PointsOfViews(capture, fitted, packed.scene.field_from_world, &depth_notes);
  for (const std::string& note : depth_notes) console->Info(note);
  for (size_t i = 0; i < fitted.size(); ++i)
    packed.views[static_cast<size_t>(fitted[i])].points = std::move(seen[i]);
  WritePackedCapture(run.out, packed);
  console->Info(Concat("wrote ", run.out, ": ", packed.views.size(), " views, ",
                       std::filesystem::file_size(run.out) >> 20, " MiB"));
}

}  // namespace regrade
