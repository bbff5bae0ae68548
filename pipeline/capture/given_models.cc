#include "pipeline/capture/given_models.h"

#include <charconv>
#include <filesystem>
#include <map>
#include <set>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/capture/dtu_cameras.h"
#include "pipeline/capture/llff_poses.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/capture/polycam_cameras.h"
#include "pipeline/capture/transforms_json.h"
#include "reconstruct/colmap/colmap_lens.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

std::string PathStem(const std::string& file) { return fs::path(file).stem().string(); }

void AddPinhole(const Camera& camera, const std::string& name, ColmapModel* model) {
  const uint32_t id = static_cast<uint32_t>(model->images.size()) + 1;
  model->cameras.push_back({id, ColmapLens::kPinhole, camera});
  model->images.push_back({id, id, name, camera.camera_from_world, {}});
}

// The camera at the size of the photo that its pixels are of.
Camera CameraOfPhoto(Camera camera, const StagedPhoto& photo, const std::string& where) {
  camera.width = photo.width;
  camera.height = photo.height;
  if (const std::string implausible = ImplausibleCamera(camera); !implausible.empty())
    throw InputError("the camera of " + photo.file + " has " + implausible, where,
                     "its pixels are those of the pictures as they were posed");
  return camera;
}

ColmapModel ModelFromTransforms(const CaptureSource& source,
                                const std::vector<StagedPhoto>& photos,
                                std::vector<std::string>* missing) {
  const fs::path folder = fs::path(source.poses).parent_path();
  std::map<fs::path, const StagedPhoto*> by_path;
  for (const StagedPhoto& photo : photos)
    by_path[(fs::path(source.photos) / photo.file).lexically_normal()] = &photo;
  const PictureSizeFunction size_of = [&by_path](const std::string& path, int* width,
                                                 int* height) {
    const auto found = by_path.find(fs::path(path).lexically_normal());
    *width = found == by_path.end() ? 1 : found->second->width;
    *height = found == by_path.end() ? 1 : found->second->height;
  };
  ColmapModel model;
  TransformsFile file = ReadTransformsJson(source.poses, size_of);
  *missing = file.missing;
  if (!source.test_poses.empty()) {
    const TransformsFile tests = ReadTransformsJson(source.test_poses, size_of);
    missing->insert(missing->end(), tests.missing.begin(), tests.missing.end());
    file.frames.insert(file.frames.end(), tests.frames.begin(), tests.frames.end());
  }
  for (const TransformsFrame& frame : file.frames) {
    const auto found = by_path.find((folder / frame.file).lexically_normal());
    if (found == by_path.end()) continue;  // left out at ingest, with a reason
    const uint32_t id = static_cast<uint32_t>(model.images.size()) + 1;
    model.cameras.push_back({id, ColmapLensOf(frame.camera.lens), frame.camera});
    model.images.push_back({id, id, found->second->name, frame.camera.camera_from_world, {}});
  }
  return model;
}

// An LLFF file has one pose for each picture of its folder, in natural order.
ColmapModel ModelFromLlff(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                          double* nearest_depth) {
  const LlffPoses poses = ReadPosesBounds(source.poses);
  if (poses.cameras.size() != photos.size())
    throw InputError(Concat(poses.cameras.size(), " poses, but ", photos.size(),
                            " usable photos in ", source.photos),
                     source.poses,
                     "an LLFF file has no photo names: all of its pictures must be present");
  *nearest_depth = poses.nearest;
  ColmapModel model;
  for (size_t i = 0; i < photos.size(); ++i) {
    AddPinhole(poses.cameras[i].Resized(photos[i].width, photos[i].height), photos[i].name,
               &model);
  }
  return model;
}

// Each picture has a pose of its name.
ColmapModel ModelFromNsvf(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                          std::vector<std::string>* missing) {
  const Camera intrinsics = ReadNsvfIntrinsics(source.intrinsics);
  ColmapModel model;
  for (const StagedPhoto& photo : photos) {
    const fs::path pose = fs::path(source.poses) / (PathStem(photo.file) + ".txt");
    if (!fs::is_regular_file(pose)) continue;  // a photo without a pose
    Camera camera = intrinsics;
    camera.camera_from_world = ReadNsvfPose(pose.string());
    AddPinhole(CameraOfPhoto(camera, photo, source.intrinsics), photo.name, &model);
  }
  if (model.images.empty())
    throw InputError("holds a pose of none of the photos", source.poses,
                     "poses have the pictures' names, and .txt");
  std::set<std::string> pictures;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(source.photos, error))
    pictures.insert(PathStem(entry.path().filename().string()));
  for (const auto& entry : fs::directory_iterator(source.poses, error))
    if (const fs::path name = entry.path().filename();
        name.extension() == ".txt" && !pictures.contains(PathStem(name.string())))
      missing->push_back(PathStem(name.string()));
  return model;
}

// Each picture has a camera of its name.
ColmapModel ModelFromPolycam(const CaptureSource& source,
                             const std::vector<StagedPhoto>& photos) {
  ColmapModel model;
  for (const StagedPhoto& photo : photos) {
    const fs::path camera = fs::path(source.poses) / (PathStem(photo.file) + ".json");
    if (fs::is_regular_file(camera))
      AddPinhole(ReadPolycamCamera(camera.string()), photo.name, &model);
  }
  if (model.images.empty())
    throw InputError("holds a camera of none of the photos", source.poses,
                     "cameras have the pictures' names, and .json");
  return model;
}

// Pictures are numbered, as their cameras are.
ColmapModel ModelFromDtu(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                         std::vector<std::string>* missing) {
  std::map<int, Camera> cameras = ReadDtuCameras(source.poses);
  ColmapModel model;
  for (const StagedPhoto& photo : photos) {
    const std::string stem = PathStem(photo.file);
    int number = -1;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    if (error != std::errc() || end != stem.data() + stem.size()) continue;
    const auto found = cameras.find(number);
    if (found == cameras.end()) continue;
    AddPinhole(CameraOfPhoto(found->second, photo, source.poses), photo.name, &model);
    cameras.erase(found);
  }
  if (model.images.empty())
    throw InputError("has a camera of none of the photos", source.poses,
                     "world_mat_7 is that of the picture 000007.png");
  for (const auto& [number, camera] : cameras)
    missing->push_back("picture " + std::to_string(number));
  return model;
}

}  // namespace

ColmapModel ModelOfPoses(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                         double* nearest_depth, std::vector<std::string>* missing) {
  switch (source.kind) {
    case CaptureKind::kTransforms:
      return ModelFromTransforms(source, photos, missing);
    case CaptureKind::kLlff:
      return ModelFromLlff(source, photos, nearest_depth);
    case CaptureKind::kNsvf:
      return ModelFromNsvf(source, photos, missing);
    case CaptureKind::kPolycam:
      return ModelFromPolycam(source, photos);
    default:
      REGRADE_CHECK(source.kind == CaptureKind::kDtu);
      return ModelFromDtu(source, photos, missing);
  }
}

}  // namespace regrade
