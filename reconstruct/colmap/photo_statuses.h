// The result of one pose attempt, and messages for a photographer about photos that could not
// be registered.
#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_output.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/colmap/simpler_lens.h"

namespace regrade {

// A model written by COLMAP and accepted by our reader.
struct FoundModel {
  ColmapModel model;
  Capture capture;
  std::string refusal;  // from AssessScene; empty: plausible
  std::string lens;     // likewise

  // Order: plausible, then number of photos, then number of points.
  auto Rank() const {
    return std::tuple(refusal.empty(), model.images.size(), model.points.size());
  }
};

struct AttemptResult {
  PoseStrategy strategy;
  LensFreedom freedom = LensFreedom::kFull;
  std::string folder;              // of the database
  std::vector<FoundModel> models;  // best first
  ColmapEvidence evidence;

  // "quick, one focal length"
  std::string Name() const;
};

struct Reason {
  std::string why, remedy;
};

// Why no strategy gave a model, according to COLMAP's output.
Reason WhyNoModel(const ColmapEvidence& evidence);

// Sets `why` of the unregistered photos, according to COLMAP's output; the first photos.size()
// statuses of the capture belong to `photos`.
void ExplainUnregistered(const AttemptResult& attempt, const std::vector<StagedPhoto>& photos,
                         Capture* capture);

// For an attempt with several models: a note with the sizes of the unused ones.
std::string NoteOnOtherModels(const AttemptResult& attempt);

// Throw Error(kScene). Refuse adds that there are too few photos, if so.
[[noreturn]] void Refuse(const Reason& reason, size_t photos_given, int min_photos);
[[noreturn]] void RefuseTooFew(size_t photos_given, int min_photos);
[[noreturn]] void RefuseUnregistered(const Capture& capture);

// Throws Error(kScene) unless the given poses of `capture`, from the file or folder `poses`,
// are as many as options ask for photos that are registered (pose-min-photos and
// pose-min-registered). Not counted are photos beside a posed one whose file has the same
// name with another extension: two files of one shot.
void RequirePoses(const Capture& capture, const std::vector<StagedPhoto>& photos,
                  const PoseOptions& options, const std::string& poses);

}  // namespace regrade
