// COLMAP's sparse model: reads and writes cameras.bin, images.bin and points3D.bin, and
// converts to a Capture.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_lens.h"

namespace regrade {

struct ColmapCamera {
  uint32_t id = 0;
  ColmapLens lens = ColmapLens::kPinhole;
  Camera intrinsics;  // its pose is not used
};

inline constexpr uint64_t kNoColmapPoint = ~uint64_t{0};

struct ColmapKeypoint {
  double u = 0, v = 0;  // pixels
  uint64_t point_id = kNoColmapPoint;
};

struct ColmapImage {
  uint32_t id = 0;
  uint32_t camera_id = 0;
  std::string name;  // a key for matching, never opened as a path
  RigidTransform camera_from_world;
  std::vector<ColmapKeypoint> keypoints;
};

struct ColmapTrackElement {
  uint32_t image_id = 0;
  uint32_t keypoint = 0;  // index into ColmapImage::keypoints
};

struct ColmapPoint {
  uint64_t id = 0;
  Vec3d position;
  std::array<uint8_t, 3> color{};
  double error = -1;  // pixels, as stored: stale after colmap's bundle_adjuster
  std::vector<ColmapTrackElement> track;
};

// Each list is sorted by id; all references are valid.
struct ColmapModel {
  std::vector<ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;

  // nullptr if there is no such id.
  const ColmapCamera* FindCamera(uint32_t id) const;
  const ColmapImage* FindImage(uint32_t id) const;
  const ColmapPoint* FindPoint(uint64_t id) const;

  // The image's camera with its pose.
  Camera CameraOf(const ColmapImage& image) const;
};

// Reads `folder`/{cameras,images,points3D}.bin, or .txt where there is no .bin. Validates
// untrusted files: counts are checked against the remaining bytes before allocation, all ids
// must exist, numbers must be finite and plausible, and no bytes may follow. Throws
// Error(kInput) with the file, the position and the reason.
ColmapModel ReadColmapModel(const std::string& folder);

// How many photos the model in `folder` has poses of, by images.bin, or images.txt where there
// is no .bin; 0 if there is neither, or if the file is too short for its count. Reads no
// record.
uint64_t CountColmapImages(const std::string& folder);

// The unit quaternion w x y z of a rotation, w >= 0.
std::array<double, 4> QuaternionOf(const Mat3d& rotation);

// Writes the three .bin files into the existing `folder`. Throws Error(kResources) if the disk
// is full. Reading them back gives the same numbers, rotations up to rounding.
void WriteColmapModel(const ColmapModel& model, const std::string& folder);

// Whether a model's image names are staged names or the user's file names.
enum class PhotoNames { kStaged, kUser };

// The photos with a pose in the model, matched by exact name, in the order of `photos`, and the
// points seen by at least two of them. Photos get the status "used" or "unregistered", images
// of the model without a photo "skipped". Computes the reprojection errors. Throws
// Error(kInput) if no name matches or a photo has another size than its camera.
Capture CaptureFromModel(const ColmapModel& model, const std::vector<StagedPhoto>& photos,
                         PhotoNames names = PhotoNames::kStaged);

}  // namespace regrade
