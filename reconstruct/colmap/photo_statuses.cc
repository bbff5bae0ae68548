#include "reconstruct/colmap/photo_statuses.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kFewFeatures = 150;  // a photo with fewer can hardly be matched

constexpr const char* kTakeMore =
    "take 20 to 60 photos that overlap by two thirds, stepping sideways between them";

std::string Photos(size_t n) { return std::to_string(n) + (n == 1 ? " photo" : " photos"); }

std::string TooFew(size_t given, int least) {
  return Concat(Photos(given), " are too few for a scene in 3D (", least, " at least)");
}

}  // namespace

std::string AttemptResult::Name() const {
  return strategy.name + (freedom == LensFreedom::kFull ? "" : ", ") + NameOf(freedom);
}

Reason WhyNoModel(const ColmapEvidence& evidence) {
  const int features = evidence.MedianFeatures();
  if (features < kFewFeatures)
    return {Concat("the photos have too few features to match (about ", features,
                   " each): they are blurred, or the scene has no texture"),
            "take sharp photos, in good light, of something with texture"};
  if (evidence.matched_pairs == 0)
    return {"no two photos show the same things from two places",
            "take photos of one static scene, each overlapping the previous one by two thirds"};
  const int photos = static_cast<int>(evidence.features.size());
  if (evidence.matched_pairs > 0 && evidence.matched_pairs < photos - 1)
    return {"only " + std::to_string(evidence.matched_pairs) + " pairs of the " +
                Photos(evidence.features.size()) +
                " show the same things: they overlap too little",
            kTakeMore};
  return {
      "no two photos show the same things from clearly different places: the camera only "
      "turned, the scene moved, or its parts look alike",
      "step sideways between photos instead of turning the camera, keep the scene still, and "
      "include surroundings that do not repeat"};
}

void ExplainUnregistered(const AttemptResult& attempt, const std::vector<StagedPhoto>& photos,
                         Capture* capture) {
  for (size_t i = 0; i < photos.size(); ++i) {
    PhotoStatus& photo = capture->statuses[i];
    if (photo.status != PhotoState::kUnregistered) continue;
    const std::string& name = photos[i].name;
    const auto features = attempt.evidence.features.find(name);
    if (features == attempt.evidence.features.end()) {
      photo.why = "COLMAP did not read it";
    } else if (features->second < kFewFeatures) {
      photo.why = Concat("only ", features->second, " features: blurred, or without texture");
    } else {
      photo.why = "it overlaps too little with the registered photos";
    }
    for (size_t k = 1; k < attempt.models.size(); ++k)
      for (const ColmapImage& image : attempt.models[k].model.images)
        if (image.name == name)
          photo.why = "it belongs to another group of " +
                      Photos(attempt.models[k].model.images.size()) +
                      " without common points with the main group";
  }
}

std::string NoteOnOtherModels(const AttemptResult& attempt) {
  std::string others;
  for (size_t k = 1; k < attempt.models.size(); ++k)
    others += (k == 1 ? "" : ", ") + std::to_string(attempt.models[k].model.images.size());
  return Concat("the photos form ", attempt.models.size(),
                " groups without common points; the largest is used (the others have ", others,
                ")");
}

void Refuse(const Reason& reason, size_t photos_given, int min_photos) {
  const bool few = static_cast<int>(photos_given) < min_photos;
  throw SceneError((few ? TooFew(photos_given, min_photos) + "; besides, " : "") + reason.why,
                   "", reason.remedy);
}

void RefuseTooFew(size_t photos_given, int min_photos) {
  throw SceneError(TooFew(photos_given, min_photos), "", kTakeMore);
}

void RefuseUnregistered(const Capture& capture) {
  std::string names;
  for (const PhotoStatus& photo : capture.statuses)
    if (photo.status == PhotoState::kUnregistered)
      names += "\n  " + photo.file + ": " + photo.why;
  throw SceneError(
      Concat("only ", capture.views.size(), " of ", Photos(capture.statuses.size()),
             " were registered in one scene; the others:", names),
      "",
      "give photos of one scene that overlap by two thirds, or lower "
      "the constant pose-min-registered (--config) to continue with the registered ones");
}

void RequirePoses(const Capture& capture, const std::vector<StagedPhoto>& photos,
                  const PoseOptions& options, const std::string& poses) {
  const auto shot = [](const std::string& file) {
    return std::filesystem::path(file).replace_extension().string();
  };
  std::set<std::string> posed, shots;
  for (const CaptureView& view : capture.views) posed.insert(shot(view.file));
  for (const StagedPhoto& photo : photos) shots.insert(shot(photo.file));
  const size_t count = capture.views.size();
  // Test pictures may have one name for two: views, and shots without any.
  const size_t all = count + shots.size() - posed.size();
  const std::string have =
      Concat(count, " of ", Photos(all), count == 1 ? " has" : " have", " a pose");
  const std::string remedy = "give poses of more of the photos, or take out photos without one";
  if (static_cast<int>(count) < options.min_photos)
    throw SceneError(Concat(have, ", and a scene in 3D needs at least ", options.min_photos),
                     poses,
                     remedy + (count < 2 ? std::string()
                                         : Concat("; --config '{\"pose-min-photos\": ", count,
                                                  "}' tries with fewer")));
  const double least = options.min_registered * static_cast<double>(all);
  if (static_cast<double>(count) < least)
    throw SceneError(have + Format(", and at least %.0f are needed", std::ceil(least)), poses,
                     remedy + ", or lower the constant pose-min-registered (--config)");
}

}  // namespace regrade
