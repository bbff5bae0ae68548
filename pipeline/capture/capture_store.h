// A capture on disk: poses/ in the output folder, with COLMAP's model, the staged photos, and
// photos.json for what neither of them says.
#pragma once

#include <string>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// What the poses of a capture were known by before.
enum class CaptureKind {
  kPhotos,      // not at all
  kPosed,       // an output folder of ours, or its poses/: photos.json, photos/ and sparse/
  kColmap,      // a folder of pictures beside sparse/ or sparse/0/
  kTransforms,  // transforms.json, or transforms_train.json of a Blender capture
  kLlff,        // poses_bounds.npy beside a folder of pictures, or among them
};

struct CaptureSource {
  CaptureKind kind = CaptureKind::kPhotos;
  std::string photos;  // the folder to take photos from, absolute
  std::string poses;   // folder of the model, or the file of poses; empty for kPhotos
};

// Tells by content. A folder of pictures beside the poses is images/, or else the first of
// images_2/, images_4/ and the like. Throws Error(kInput) if there is no such folder.
CaptureSource DetectCapture(const std::string& folder);

// What photos.json of a kPosed capture says of Capture::nearest_depth; 0 of others.
double NearestDepthOf(const CaptureSource& source);

// Poses that came with the photos, for those that were staged; the model is written to
// `sparse_folder`. Photos that were resampled since get cameras of their size. `notes`:
// sentences for a person. Throws Error(kInput) if photos and poses do not fit each other.
Capture ImportPoses(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                    const std::vector<PhotoStatus>& statuses, const std::string& sparse_folder,
                    std::vector<std::string>* notes);

// `folder` holds sparse/ and photos/ already; this adds photos.json.
void WriteCaptureIndex(const std::string& folder, const Capture& capture,
                       const std::vector<StagedPhoto>& photos);

// Reads it all back. Throws Error(kInput).
Capture ReadCapture(const std::string& folder);

}  // namespace regrade
