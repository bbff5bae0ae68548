#include "pipeline/capture/synth_capture.h"

#include <charconv>
#include <filesystem>
#include <vector>

#include "evaluate/flow_file.h"
#include "kernels/base/error.h"
#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "pipeline/capture/synth_effects.h"
#include "pipeline/capture/synth_grade.h"
#include "pipeline/capture/synth_model.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/depth_map.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kLeastSynthSide = 16, kMostSynthSide = 8192;  // pixels

std::string FrameName(int index, const char* extension) {
  return Format("%05d%s", index, extension);
}

void ParseSize(const std::string& size, int* width, int* height) {
  const char* const end = size.data() + size.size();
  const auto [x, bad_width] = std::from_chars(size.data(), end, *width);
  if (bad_width == std::errc() && x != end && *x == 'x') {
    const auto [rest, bad_height] = std::from_chars(x + 1, end, *height);
    if (bad_height == std::errc() && rest == end && *width >= kLeastSynthSide &&
        *width <= kMostSynthSide && *height >= kLeastSynthSide && *height <= kMostSynthSide)
      return;
  }
  throw UsageError("\"" + size + "\" is not an image size", "--size",
                   "write WIDTHxHEIGHT, each from 16 to 8192, e.g. 640x480");
}

JsonValue Vector(const Vec3d& v) { return JsonValue::Array{v.x, v.y, v.z}; }

// The masked object: the first ball.
int MaskedSolid(const SyntheticScene& scene) {
  for (size_t i = 0; i < scene.solids.size(); ++i)
    if (scene.solids[i].shape == Shape::kSphere) return static_cast<int>(i);
  return 0;
}

// The options and the parameters of the effects.
JsonValue DescribeCapture(const SynthOptions& options, const SynthEffects& effects,
                          const SyntheticScene& scene) {
  const auto off = [] { return JsonValue(JsonValue::Object{{"on", false}}); };
  JsonValue exposure = off(), noise = off(), distortion = off(), highlights = off();
  if (effects.exposure) {
    JsonValue::Array gains;
    for (int i = 0; i < options.views; ++i)
      gains.push_back(SynthGain(options.seed, i, options.views));
    exposure = JsonValue::Object{{"on", true}, {"of", "linear light"}, {"gains", gains}};
  }
  if (effects.noise)
    noise = JsonValue::Object{
        {"on", true}, {"of", "encoded values in [0, 1]"}, {"sigma", kSynthNoiseSigma}};
  if (effects.distortion)
    distortion = JsonValue::Object{{"on", true},     {"model", "OPENCV"}, {"k1", kSynthK1},
                                   {"k2", kSynthK2}, {"p1", 0.0},         {"p2", 0.0}};
  if (effects.barrel)
    distortion = JsonValue::Object{{"on", true}, {"model", "OPENCV"}, {"k1", kSynthBarrelK1},
                                   {"k2", 0.0},  {"p1", 0.0},         {"p2", 0.0}};
  if (effects.fisheye)
    distortion = JsonValue::Object{{"on", true}, {"model", "OPENCV_FISHEYE"},
                                   {"k1", 0.0},  {"k2", 0.0},
                                   {"k3", 0.0},  {"k4", 0.0}};
  if (effects.highlights)
    highlights = JsonValue::Object{
        {"on", true}, {"exponent", kSunSharpness}, {"to_sun", Vector(scene.to_sun)}};
  JsonValue of_effects = JsonValue::Object{{"exposure", exposure},
                                           {"noise", noise},
                                           {"distortion", distortion},
                                           {"highlights", highlights}};
  if (effects.masks)
    of_effects["masks"] = JsonValue::Object{{"on", true}, {"solid", MaskedSolid(scene)}};
  if (effects.mixed_cameras)
    of_effects["mixed_cameras"] = JsonValue::Object{
        {"on", true}, {"second_size", kSynthSecondSize}, {"second_focal", kSynthSecondFocal}};
  if (effects.poses)
    of_effects["poses"] = JsonValue::Object{{"on", true},
                                            {"turn_degrees", kSynthPoseTurn},
                                            {"step_fraction", kSynthPoseStep},
                                            {"track_sigma_px", kSynthTrackSigma}};
  JsonValue::Object description{{"scene", options.scene},
                                {"seed", options.seed},
                                {"views", options.views},
                                {"size", options.size},
                                {"bounds_min", Vector(scene.bounds_min)},
                                {"bounds_max", Vector(scene.bounds_max)},
                                {"effects", of_effects}};
  if (!options.grade.empty()) description.emplace_back("grade", options.grade);
  if (!options.flow) description.emplace_back("flow", false);
  return description;
}

// Creates the folders. Throws Error(kFolderInUse) if there are photos made with other options.
void ClaimFolder(const fs::path& out, const JsonValue& description, bool with_masks,
                 bool with_flow) {
  const fs::path record = out / "truth" / "effects.json";
  std::error_code none;
  const bool has_photos = fs::exists(out / "images") && !fs::is_empty(out / "images", none);
  if (has_photos && !(fs::exists(record) && ReadJsonFile(record.string()) == description))
    throw Error(ExitCode::kFolderInUse, "the folder contains other photos",
                (out / "images").string(), "name another folder, or remove this one first");
  std::vector<const char*> folders = {"images", "truth/depth"};
  if (with_flow) folders.insert(folders.end(), {"truth/flow", "truth/visible"});
  if (with_masks) folders.insert(folders.end(), {"masks", "truth/masks"});
  for (const char* folder : folders) {
    std::error_code error;
    fs::create_directories(out / folder, error);
    if (error)
      throw ResourceError("cannot create a folder: " + error.message(),
                          (out / folder).string());
  }
  WriteJsonFile(record.string(), description);
}

void WriteMotion(const fs::path& truth, int from, int to, SyntheticMotion motion) {
  FlowField flow;
  flow.width = motion.width;
  flow.height = motion.height;
  flow.uv = std::move(motion.uv);
  const std::string name = FlowFileName(from, to);
  WriteFlowFile((truth / "flow" / name).string(), flow);
  Image mask(motion.width, motion.height, 1);
  for (size_t i = 0; i < motion.visible.size(); ++i) mask.pixels[i] = motion.visible[i];
  WritePng8((truth / "visible" / fs::path(name).replace_extension(".png")).string(), mask);
}

}  // namespace

void WriteSyntheticCapture(const std::string& out, const SynthOptions& options,
                           const ProgressFunction& progress) {
  int width = 0, height = 0;
  ParseSize(options.size, &width, &height);
  const SynthEffects effects = ParseSynthEffects(options.effects);
  const SynthGrade grade = ParseSynthGrade(options.grade);
  const SyntheticScene scene = MakeSyntheticScene(options.scene, options.seed);
  std::vector<Camera> cameras = SyntheticCameras(scene, options.views, width, height);
  for (int i = 0; i < options.views; ++i)
    cameras[i] = WithSynthLens(effects, WithSynthBody(effects, i, cameras[i]));
  ClaimFolder(out, DescribeCapture(options, effects, scene), effects.masks, options.flow);

  const fs::path truth = fs::path(out) / "truth";
  std::vector<TransformsFrame> frames;
  std::vector<Image> depths;  // of all views, with effect poses
  for (int i = 0; i < options.views; ++i) {
    SyntheticView view = RenderSyntheticView(scene, cameras[i], effects.highlights);
    if (effects.exposure) ApplyGain(SynthGain(options.seed, i, options.views), &view.color);
    if (effects.noise) ApplyNoise(options.seed, i, kSynthNoiseSigma, &view.color);
    const std::string name = FrameName(i, ".png");
    WritePng8((fs::path(out) / "images" / name).string(), view.color);
    WriteDepthMap((truth / "depth" / FrameName(i, ".npy")).string(), view.depth);
    if (grade != SynthGrade::kNone) {
      ApplyGrade(grade, scene, cameras[i], view.depth, MaskedSolid(scene), &view.color);
      fs::create_directories(truth / "graded");
      WritePng8((truth / "graded" / name).string(), view.color);
    }
    if (effects.masks) {
      const Image mask = RenderSolidMask(scene, cameras[i], MaskedSolid(scene));
      WritePng8((truth / "masks" / name).string(), mask);
      WritePng8((fs::path(out) / "masks" / name).string(), FaultyMask(mask, SynthMaskFault(i)));
    }
    for (const int gap : kSynthGaps)
      for (const int j : {i - gap, i + gap})
        if (options.flow && j >= 0 && j < options.views)
          WriteMotion(truth, i, j, TrueMotion(scene, cameras[i], cameras[j]));
    frames.push_back({"../images/" + name, cameras[i]});
    if (effects.poses) depths.push_back(std::move(view.depth));
    ReportOrThrow(progress, i + 1, options.views, name);
  }
  WriteTransformsJson((truth / "transforms.json").string(), frames);
  if (!effects.poses) return;
  std::vector<std::string> names;
  for (size_t i = 0; i < depths.size(); ++i)
    names.push_back(FrameName(static_cast<int>(i), ".png"));
  fs::create_directories(fs::path(out) / "sparse" / "0");
  WriteColmapModel(PerturbedModel(TracksOf(cameras, depths, names, options.seed), options.seed),
                   (fs::path(out) / "sparse" / "0").string());
}

}  // namespace regrade
