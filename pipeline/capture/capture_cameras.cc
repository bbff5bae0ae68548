#include "pipeline/capture/capture_cameras.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "kernels/process/private_folder.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/ingest_photos.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {
namespace {

std::vector<BareCamera> CamerasOf(const Capture& capture) {
  std::vector<BareCamera> cameras;
  for (const CaptureView& view : capture.views)
    cameras.push_back({view.file, view.camera.Undistorted()});
  return cameras;
}

// As the stage "pose" imports it, without keeping the photos.
std::vector<BareCamera> ImportedCameras(const CaptureSource& source,
                                        const ProgressFunction& progress) {
  const PrivateFolder work;
  IngestOptions options;
  options.take_clips = options.one_a_shot = false;
  options.only = source.only;
  options.not_photos = source.not_photos;
  IngestResult ingest = IngestPhotos(source.photos, work / "photos", options, progress);
  std::filesystem::create_directories(work / "sparse");
  std::vector<std::string> notes;
  return CamerasOf(
      ImportPoses(source, &ingest.photos, ingest.statuses, work / "sparse", &notes));
}

std::vector<BareCamera> CamerasWithPhotos(const CaptureSource& source,
                                          const ProgressFunction& progress) {
  if (source.kind == CaptureKind::kPosed)
    return CamerasOf(ReadCapture(std::filesystem::path(source.photos).parent_path().string()));
  if (source.kind != CaptureKind::kColmap) return ImportedCameras(source, progress);
  std::vector<BareCamera> cameras;
  const ColmapModel model = ReadColmapModel(source.poses);
  for (const ColmapImage& image : model.images)
    cameras.push_back({image.name, model.CameraOf(image).Undistorted()});
  return cameras;
}

}  // namespace

void RequireCameras(const CaptureSource& source, const std::string& path) {
  if (source.kind == CaptureKind::kPhotos)
    throw InputError("has no cameras", path,
                     "give a folder of photos with poses, a COLMAP model or a cameras.json; or "
                     "leave --cameras out");
}

std::vector<BareCamera> CamerasOfCapture(const std::string& path,
                                         const ProgressFunction& progress) {
  std::vector<BareCamera> cameras = ReadBareCameras(path);
  if (cameras.empty()) {
    const CaptureSource source = DetectCapture(path);
    RequireCameras(source, path);
    cameras = CamerasWithPhotos(source, progress);
  }
  if (cameras.empty()) throw InputError("lists no camera", path);
  std::ranges::stable_sort(cameras, NaturalLess, &BareCamera::name);
  return cameras;
}

}  // namespace regrade
