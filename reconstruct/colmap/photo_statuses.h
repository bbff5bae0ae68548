// What one attempt of the strategies found, and the sentences that explain to a photographer
// why photos could not be placed.
#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_output.h"

namespace regrade {

// One model that COLMAP wrote and our reader accepted.
struct FoundModel {
  ColmapModel model;
  Capture capture;
  std::string refusal;  // by AssessScene; empty: plausible

  // Plausible before implausible, then more photos, then more points.
  auto Rank() const {
    return std::tuple(refusal.empty(), model.images.size(), model.points.size());
  }
};

struct AttemptResult {
  std::string recipe;
  std::vector<FoundModel> models;  // best first
  ColmapEvidence evidence;
};

struct Reason {
  std::string why, remedy;
};

// Why no recipe gave a model, as far as COLMAP's output tells.
Reason WhyNoModel(const ColmapEvidence& evidence);

// Fills in `why` of the unregistered photos; the first photos.size() statuses of the capture
// are theirs. Says only what COLMAP's output proves.
void ExplainUnregistered(const AttemptResult& attempt, const std::vector<StagedPhoto>& photos,
                         Capture* capture);

// For a attempt with several models: the sizes of those that are not used.
std::string NoteOnOtherModels(const AttemptResult& attempt);

// Throw Error(kScene). Refuse adds that the photos are too few, where they are.
[[noreturn]] void Refuse(const Reason& reason, size_t photos_given, int min_photos);
[[noreturn]] void RefuseTooFew(size_t photos_given, int min_photos);
[[noreturn]] void RefuseUnregistered(const Capture& capture);

}  // namespace regrade
