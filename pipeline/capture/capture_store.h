// A capture on disk: folder poses/ with COLMAP's model, the staged photos, and photos.json with
// the rest.
#pragma once

#include <string>

#include "kernels/scene/capture.h"
#include "pipeline/capture/capture_source.h"
#include "pipeline/files/json_file.h"

namespace regrade {

// What the photos.json of a kPosed capture knows beside its model: "nearest_depth", and "test"
// (photos) and "box" where it has them.
JsonValue KnownBesideModel(const CaptureSource& posed);

// Reads given poses of the staged photos and writes the model to `sparse_folder`. Photos that
// were resampled since get cameras of their size; EXIF orientation is matched, which may stage
// photos again (posed_orientation.h). Cameras that are impossibly far away (far_cameras.h) are
// left out. `notes`: sentences for the user. Throws Error(kInput) if photos and poses do not
// fit each other.
Capture ImportPoses(const CaptureSource& source, std::vector<StagedPhoto>* staged,
                    const std::vector<PhotoStatus>& statuses, const std::string& sparse_folder,
                    std::vector<std::string>* notes);

// `folder` holds sparse/ and photos/ already; this adds photos.json.
void WriteCaptureIndex(const std::string& folder, const Capture& capture,
                       const std::vector<StagedPhoto>& photos);

// Throws Error(kInput); for a photos.json of another schema, too.
Capture ReadCapture(const std::string& folder);

}  // namespace regrade
