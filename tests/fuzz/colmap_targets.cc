// Fuzz targets: COLMAP's cameras, images and points, binary and text. One file is mutated, the
// two others are those of a small model.
#include <filesystem>
#include <limits>

#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_text.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/synthetic_model.h"

namespace regrade::testing {
namespace {

enum File { kCameras, kImages, kPoints };
constexpr const char* kNames[] = {"cameras", "images", "points3D"};

ColmapModel SmallModel() { return MakeSyntheticModel({.images = 3, .points = 4}); }

// A folder with the small model, without the mutated file.
const std::string& Folder(File file, bool text) {
  static std::string folders[3][2];
  std::string& folder = folders[file][text];
  if (!folder.empty()) return folder;
  folder = FuzzFolder() + "/" + kNames[file] + (text ? "_text" : "");
  std::filesystem::create_directories(folder);
  WriteColmapModel(SmallModel(), folder);
  std::filesystem::remove(folder + "/" + kNames[file] + ".bin");
  return folder;
}

std::string Place(File file, bool text) {
  return std::filesystem::path(Folder(file, text)).filename().string() + "/" + kNames[file] +
         (text ? ".txt" : ".bin");
}

std::string BytesOf(const ColmapModel& model, File file, bool text) {
  const std::string folder = FuzzFolder() + "/written";
  std::filesystem::create_directories(folder);
  text ? WriteColmapText(model, folder) : WriteColmapModel(model, folder);
  return ReadText(folder + "/" + kNames[file] + (text ? ".txt" : ".bin"));
}

// The guarantees of colmap_model.h for an accepted model.
void CheckModel(const ColmapModel& model) {
  for (const ColmapImage& image : model.images) {
    const Camera camera = model.CameraOf(image);  // exists
    FuzzRequire(std::abs(camera.camera_from_world.rotation.Determinant() - 1) < 1e-9,
                "a pose is a rotation");
    for (const ColmapKeypoint& keypoint : image.keypoints)
      FuzzRequire(
          std::isfinite(keypoint.u) && std::isfinite(keypoint.v) &&
              (keypoint.point_id == kNoColmapPoint || model.FindPoint(keypoint.point_id)),
          "keypoints are finite and their points exist");
    double u, v;
    camera.Project({0, 0, 0}, &u, &v);
  }
  for (const ColmapPoint& point : model.points)
    for (const ColmapTrackElement& element : point.track)
      FuzzRequire(element.keypoint < model.FindImage(element.image_id)->keypoints.size(),
                  "tracks lead to keypoints");
}

template <File file, bool text>
bool ReadIt(std::string_view bytes) {
  FuzzFile(Place(file, text), bytes);
  return Accepts([] {
    const ColmapModel model = ReadColmapModel(Folder(file, text));
    CheckModel(model);
    // An accepted model is accepted again after it was written.
    const std::string again = FuzzFolder() + "/again";
    std::filesystem::create_directories(again);
    WriteColmapModel(model, again);
    const ColmapModel back = ReadColmapModel(again);
    FuzzRequire(
        back.images.size() == model.images.size() && back.points.size() == model.points.size(),
        "a round trip keeps everything");
    try {
      CaptureFromModel(model, PhotosOf(SmallModel()));
    } catch (const Error&) {
    }
  });
}

template <File file, bool text>
std::vector<std::string> Seeds() {
  ColmapModel model = SmallModel();
  std::vector<std::string> seeds = {BytesOf(model, file, text)};
  if (file == kCameras)
    for (const ColmapLens lens : {ColmapLens::kPinhole, ColmapLens::kFullOpenCv}) {
      model.cameras[0].lens = lens;
      model.cameras[0].intrinsics.lens = InfoOf(lens).lens;
      seeds.push_back(BytesOf(model, file, text));
    }
  if (file == kImages) {
    model.images[1].name = "a name with spaces \xc3\xa9.jpg";
    for (ColmapKeypoint& keypoint : model.images[2].keypoints)
      keypoint.point_id = kNoColmapPoint;
    seeds.push_back(BytesOf(model, file, text));
  }
  return seeds;
}

double AnyDouble(FuzzRandom* random) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double values[] = {0,
                           -0.0,
                           1,
                           -1,
                           1e-300,
                           1e300,
                           1e12,
                           1e13,
                           kInfinity,
                           -kInfinity,
                           std::numeric_limits<double>::quiet_NaN(),
                           1e-3,
                           640,
                           1e9};
  return values[random->Below(std::size(values))];
}

// A mutation that is consistent with counts and lengths.
void ChangeModel(ColmapModel* model, FuzzRandom* random) {
  const auto any = [random](auto& list) -> auto& { return list[random->Below(list.size())]; };
  if (model->cameras.empty() || model->images.empty() || model->points.empty()) return;
  ColmapImage& image = any(model->images);
  ColmapPoint& point = any(model->points);
  Camera& camera = any(model->cameras).intrinsics;
  switch (random->Below(14)) {
    case 0:
      model->cameras.push_back(any(model->cameras));
      break;
    case 1:
      image.id = static_cast<uint32_t>(random->Below(5));
      break;
    case 2:
      point.id = random->Below(6);
      break;
    case 3:
      image.camera_id = static_cast<uint32_t>(random->Below(3));
      break;
    case 4:
      if (!image.keypoints.empty()) any(image.keypoints).point_id = random->Below(6);
      break;
    case 5:
      if (!point.track.empty())
        any(point.track) = {static_cast<uint32_t>(random->Below(5)),
                            static_cast<uint32_t>(random->Below(6))};
      break;
    case 6:
      image.keypoints.resize(random->Below(6));
      break;
    case 7:
      image.name =
          std::string(random->Below(2) ? 4090 + random->Below(10) : random->Below(3), '/');
      break;
    case 8:
      image.camera_from_world.translation[static_cast<int>(random->Below(3))] =
          AnyDouble(random);
      break;
    case 9:
      image.camera_from_world.rotation(static_cast<int>(random->Below(3)),
                                       static_cast<int>(random->Below(3))) = AnyDouble(random);
      break;
    case 10:
      point.position[static_cast<int>(random->Below(3))] = AnyDouble(random);
      break;
    case 11:
      (random->Below(2) ? camera.fx : camera.cx) = AnyDouble(random);
      break;
    case 12:
      camera.width = static_cast<int>(random->Bits());
      break;
    default:
      // A lens that is not supported cannot be written.
      any(model->cameras).lens = static_cast<ColmapLens>(random->Below(7));
  }
}

template <File file, bool text>
std::string Mutate(std::string bytes, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"\n",
                                                  "#",
                                                  "\n\n",
                                                  "FOV",
                                                  "OPENCV",
                                                  "SIMPLE_PINHOLE",
                                                  "\t",
                                                  " ",
                                                  "\r\n",
                                                  "-1",
                                                  "18446744073709551615",
                                                  "image.png",
                                                  "../../x",
                                                  std::string(1, '\0')};
  if (random->Chance(0.4)) {
    FuzzFile(Place(file, text), bytes);
    try {
      ColmapModel model = ReadColmapModel(Folder(file, text));
      ChangeModel(&model, random);
      return BytesOf(model, file, text);
    } catch (const Error&) {
    }
  }
  return text ? MutateText(std::move(bytes), kWords, random)
              : MutateBytes(std::move(bytes), random);
}

template <File file, bool text>
FuzzTarget Target(const char* name) {
  return {name, Seeds<file, text>, ReadIt<file, text>, Mutate<file, text>};
}

}  // namespace

std::vector<FuzzTarget> ColmapTargets() {
  return {Target<kCameras, false>("colmap_cameras_bin"),
          Target<kImages, false>("colmap_images_bin"),
          Target<kPoints, false>("colmap_points_bin"),
          Target<kCameras, true>("colmap_cameras_txt"),
          Target<kImages, true>("colmap_images_txt"),
          Target<kPoints, true>("colmap_points_txt")};
}

}  // namespace regrade::testing
