// A capture on disk: folder poses/ with COLMAP's model, the staged photos, and photos.json with
// the rest.
#pragma once

#include <string>

#include "kernels/scene/capture.h"

namespace regrade {

// Where the poses of a capture come from.
enum class CaptureKind {
  kPhotos,      // none: COLMAP finds them
  kPosed,       // an output folder of regrade, or its poses/: photos.json, photos/ and sparse/
  kColmap,      // a folder of pictures beside sparse/ or sparse/0/
  kTransforms,  // transforms.json, or transforms_train.json of a Blender capture
  kLlff,        // poses_bounds.npy beside a folder of pictures, or among them
};

struct CaptureSource {
  CaptureKind kind = CaptureKind::kPhotos;
  std::string photos;  // the folder to take photos from, or a film; absolute
  std::string poses;   // folder of the model, or the file of poses; empty for kPhotos
};

// Decides by content. A file counts as a film, of which poses are found. The folder of pictures
// beside poses is images/, or else the first of images_2/, images_4/ and so on. Throws
// Error(kInput) if there is no such folder.
CaptureSource DetectCapture(const std::string& folder);

// Capture::nearest_depth by the photos.json of a kPosed capture; 0 for others.
double NearestDepthOf(const CaptureSource& source);

// Reads given poses of the staged photos and writes the model to `sparse_folder`. Photos that
// were resampled since get cameras of their size. `notes`: sentences for the user. Throws
// Error(kInput) if photos and poses do not fit each other.
Capture ImportPoses(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                    const std::vector<PhotoStatus>& statuses, const std::string& sparse_folder,
                    std::vector<std::string>* notes);

// `folder` holds sparse/ and photos/ already; this adds photos.json.
void WriteCaptureIndex(const std::string& folder, const Capture& capture,
                       const std::vector<StagedPhoto>& photos);

// Throws Error(kInput); for a photos.json of another schema, too.
Capture ReadCapture(const std::string& folder);

}  // namespace regrade
