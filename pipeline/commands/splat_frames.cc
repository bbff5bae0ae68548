#include "pipeline/commands/splat_frames.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/capture/capture_cameras.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/commands/evaluate_frames.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/images/depth_map.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/foreign_splats.h"
#include "pipeline/stages/splat_views.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kPathFrames = 120;     // of a path past cameras: five seconds at kSampleRate
constexpr int kComparedDepths = 12;  // frames on which geometries are compared, at most
constexpr double kSameDepth = 0.05;  // fraction of the depth, as that of GeometricFlow
// A larger part of the surface at another depth is said: edges and rounding stay below.
constexpr double kOtherGeometry = 0.05;

struct DrawnSplats {
  DrawnSplats(const std::string& path, const Vec3f& background, Console* console)
      : scene(Before(background, ReadForeignSplats(path, 0, console))),
        field(FieldInItsWorld(scene)),
        renderer(field, ChooseBackend("auto", false)) {}

  static SplatScene Before(const Vec3f& background, SplatScene scene) {
    scene.splats.background = background;
    return scene;
  }

  SplatScene scene;
  RadianceField field;
  FieldRenderer renderer;
};

// How far the surfaces of two scenes are at the same depths.
struct DepthComparison {
  int64_t surface = 0, differs = 0;  // pixels where either shows a surface

  void Add(const Image& a, const Image& b) {
    for (size_t i = 0; i < a.pixels.size(); ++i) {
      const double here = a.pixels[i], there = b.pixels[i];
      if (here <= 0 && there <= 0) continue;
      ++surface;
      differs += here <= 0 || there <= 0 || std::abs(there - here) > kSameDepth * here;
    }
  }
  double Share() const {
    return static_cast<double>(differs) / static_cast<double>(std::max<int64_t>(surface, 1));
  }
};

bool ShowsSurface(const Image& depth) {
  return std::ranges::any_of(depth.pixels, [](float z) { return z > 0; });
}

Vec3f BackgroundOf(const SplatFrames& frames) {
  if (frames.background == "white") return {1, 1, 1};
  const fs::path field = fs::path(frames.views.cameras) / "field.npz";
  if (frames.background == "black" || frames.views.cameras.empty() || !fs::exists(field))
    return {0, 0, 0};
  return ReadFieldGeometry(field.string()).field.background;
}

// Removes what an earlier call wrote, and nothing else.
void RemoveEarlierFrames(const std::string& folder) {
  std::vector<fs::path> earlier;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name == kReferenceFrames || name == kReferenceDepth || name == kFrameCameras ||
        name.starts_with(StyledName(0)))
      earlier.push_back(entry.path());
  }
  for (const fs::path& path : earlier) fs::remove_all(path);
}

std::vector<Camera> CamerasOfFrames(const SplatFrames& frames, const DrawnSplats& reference,
                                    Console* console, const ProgressFunction& progress) {
  const std::string& given = frames.views.cameras;
  std::vector<Camera> cameras;
  for (const auto& [name, camera] :
       given.empty() ? PlacedCameras(reference.scene.splats, reference.field,
                                     ChooseBackend("auto", false), frames.views.up, frames.size,
                                     frames.reference, console, progress)
                     : CamerasOfCapture(given, progress))
    cameras.push_back(ReducedTo(frames.size, camera));
  const std::string from = given.empty() ? "the placed views" : "the cameras of " + given;
  std::string how = "frames at " + from + ", in their order";
  if (given.empty() || !std::ranges::is_sorted(SmoothOrder(cameras))) {
    PathClearance clearance;
    const double width = WidthOfPath(cameras, {}, reference.field, &clearance);
    cameras = MakeCameraPath(cameras, {}, EvenMoments(kPathFrames), width);
    how = "frames of a path past " + from +
          (given.empty() ? "" : ", which are in no order without jumps");
  } else {
    cameras = WithCommonIntrinsics(cameras);
  }
  console->Info(
      Concat(cameras.size(), " ", how, ", ", cameras[0].width, "x", cameras[0].height, " px"));
  return cameras;
}

void CheckSeen(int64_t seen, size_t frames, const std::string& file, const std::string& remedy,
               Console* console) {
  if (seen == 0) throw InputError("no camera sees anything of these splats", file, remedy);
  if (seen < static_cast<int64_t>(frames))
    console->Warn(Concat(file, ": ", static_cast<int64_t>(frames) - seen, " of ", frames,
                         " frames show nothing of it"));
}

}  // namespace

std::vector<std::string> RenderSplatFrames(const SplatFrames& frames, Console* console) {
  const std::string folder = frames.folder + "/";
  RemoveEarlierFrames(frames.folder);
  ProgressParts parts(console->StageProgress(), 2 + static_cast<double>(frames.styled.size()));
  const Vec3f background = BackgroundOf(frames);
  std::vector<Camera> cameras;
  std::vector<Image> depths;  // of the reference, those that are compared
  size_t step = 1;
  // Calls `also` with the place and the depth of each frame.
  const auto render = [&](const FieldRenderer& renderer, const std::string& name,
                          const auto& also) {
    const ProgressFunction progress = parts.Next(1);
    fs::create_directories(folder + name);
    int64_t seen = 0;
    for (size_t i = 0; i < cameras.size(); ++i) {
      ReportOrThrow(progress, static_cast<double>(i), static_cast<double>(cameras.size()));
      const RenderedView view = renderer.Render(cameras[i]);
      WritePng8(folder + name + "/" + FrameName(static_cast<int>(i)), view.color);
      seen += ShowsSurface(view.depth);
      also(i, view.depth);
    }
    return seen;
  };
  {
    const DrawnSplats reference(frames.reference, background, console);
    cameras = CamerasOfFrames(frames, reference, console, parts.Next(1));
    step = (cameras.size() + kComparedDepths - 1) / kComparedDepths;
    fs::create_directories(folder + kReferenceDepth);
    std::vector<TransformsFrame> listed;
    const int64_t seen =
        render(reference.renderer, kReferenceFrames, [&](size_t i, const Image& depth) {
          WriteDepthMap(folder + kReferenceDepth + Format("/%05zu.npy", i), depth);
          listed.push_back(
              {std::string(kReferenceFrames) + "/" + FrameName(static_cast<int>(i)),
               cameras[i]});
          if (i % step == 0) depths.push_back(depth);
        });
    CheckSeen(seen, cameras.size(), frames.reference,
              "give --cameras in the world of the splats", console);
    WriteTransformsJson(folder + kFrameCameras, listed);
  }
  std::vector<std::string> remarks;
  for (size_t k = 0; k < frames.styled.size(); ++k) {
    const std::string& file = frames.styled[k];
    const DrawnSplats styled(file, background, console);
    DepthComparison depth_of;
    const int64_t seen =
        render(styled.renderer, StyledName(k), [&](size_t i, const Image& depth) {
          if (i % step == 0) depth_of.Add(depths[i / step], depth);
        });
    CheckSeen(seen, cameras.size(), file, "give a file in the world of --reference", console);
    if (depth_of.Share() <= kOtherGeometry) continue;
    remarks.push_back(
        Format("%.0f %% of its surface is not at the depth of the reference's, "
               "whose motion and masks are used",
               100 * depth_of.Share()));
    remarks.back() = file + ": " + remarks.back();
    console->Warn(remarks.back());
  }
  return remarks;
}

}  // namespace regrade
