#include "pipeline/capture/posed_orientation.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/capture/staged_files.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/normalize_photo.h"
#include "reconstruct/colmap/resized_model.h"
#include "reconstruct/colmap/turned_model.h"

namespace regrade {
namespace {

using PhotosByName = std::map<std::string, StagedPhoto*>;

// Positive if cameras have the sizes of stored pictures, negative if those of upright ones.
int VotesOfSizes(const ColmapModel& model, const PhotosByName& photos) {
  int votes = 0;
  for (const ColmapImage& image : model.images) {
    const auto found = photos.find(image.name);
    if (found == photos.end()) continue;
    const StagedPhoto& photo = *found->second;
    if (photo.orientation < 5) continue;
    const Camera& camera = model.FindCamera(image.camera_id)->intrinsics;
    votes += SameAspect(camera, photo.height, photo.width);
    votes -= SameAspect(camera, photo.width, photo.height);
  }
  return votes;
}

// The spread of the colours that a point's observations have, in one reading.
class ColorSpread {
 public:
  void Add(const Vec3d& color) {
    sum_ += color;
    squares_ += Dot(color, color);
    ++count_;
  }
  double Sum() const { return count_ == 0 ? 0 : squares_ - Dot(sum_, sum_) / count_; }

 private:
  Vec3d sum_;
  double squares_ = 0;
  int count_ = 0;
};

// The colour at an image point; nearest pixel.
Vec3d ColorAt(const Image& image, double u, double v) {
  const float* const pixel = image.at(std::clamp(static_cast<int>(u), 0, image.width - 1),
                                      std::clamp(static_cast<int>(v), 0, image.height - 1));
  return {pixel[0], pixel[1], pixel[2]};
}

// Whether the points' colours agree better if observations are in upright pictures.
bool PointsSayUpright(const ColmapModel& model, const PhotosByName& photos) {
  std::map<uint64_t, std::pair<ColorSpread, ColorSpread>> spreads;  // stored, upright
  for (const ColmapImage& image : model.images) {
    const auto found = photos.find(image.name);
    if (found == photos.end() || image.keypoints.empty()) continue;
    const StagedPhoto& photo = *found->second;
    const Camera& camera = model.FindCamera(image.camera_id)->intrinsics;
    const Image picture = ReadImage(photo.path);
    if (picture.channels != 3) continue;
    for (const ColmapKeypoint& keypoint : image.keypoints) {
      if (keypoint.point_id == kNoColmapPoint) continue;
      auto& [stored, upright] = spreads[keypoint.point_id];
      double u = keypoint.u, v = keypoint.v;
      upright.Add(ColorAt(picture, u * picture.width / camera.width,
                          v * picture.height / camera.height));
      TurnPoint(photo.orientation, camera.width, camera.height, &u, &v);
      const bool across = photo.orientation >= 5;
      stored.Add(ColorAt(picture, u * picture.width / (across ? camera.height : camera.width),
                         v * picture.height / (across ? camera.width : camera.height)));
    }
  }
  double as_stored = 0, as_upright = 0;
  for (const auto& [id, spread] : spreads) {
    as_stored += spread.first.Sum();
    as_upright += spread.second.Sum();
  }
  return as_upright < as_stored;
}

// The orientation that undoes one.
int Undoing(int orientation) {
  return orientation == 6 ? 8 : orientation == 8 ? 6 : orientation;
}

void StageAsStored(StagedPhoto* photo) {
  const int undoing = Undoing(photo->orientation);
  StagePicture(photo->path, Upright(ReadImage(photo->path), undoing), photo->bits);
  const std::string alpha =
      std::filesystem::path(photo->path).replace_extension(".alpha.png").string();
  if (std::filesystem::is_regular_file(alpha))
    StagePicture(alpha, Upright(ReadImage(alpha), undoing), 8);
  if (photo->orientation >= 5) std::swap(photo->width, photo->height);
  photo->orientation = 1;
}

}  // namespace

std::vector<StagedPhoto> AsStored(std::vector<StagedPhoto> photos) {
  for (StagedPhoto& photo : photos)
    if (photo.orientation >= 5) std::swap(photo.width, photo.height);
  return photos;
}

std::string MatchOrientations(ColmapModel* model, std::vector<StagedPhoto>* photos) {
  PhotosByName by_name;
  for (StagedPhoto& photo : *photos) by_name[photo.name] = &photo;
  std::map<std::string, int> turns;
  std::vector<StagedPhoto*> mirrored;
  for (const ColmapImage& image : model->images)
    if (const auto found = by_name.find(image.name);
        found != by_name.end() && found->second->orientation != 1) {
      if (IsTurn(found->second->orientation))
        turns[image.name] = found->second->orientation;
      else
        mirrored.push_back(found->second);
    }
  const size_t count = turns.size() + mirrored.size();
  if (count == 0) return "";
  const int votes = VotesOfSizes(*model, by_name);
  const bool upright = votes != 0 ? votes < 0 : PointsSayUpright(*model, by_name);
  const std::string what = Concat(count, count == 1 ? " photo has" : " photos have",
                                  " an EXIF orientation, and by the ",
                                  votes != 0              ? "cameras' sizes"
                                  : model->points.empty() ? "rule for poses without points"
                                                          : "points' colours",
                                  " the poses are of the pictures ");
  if (upright) return what + "turned upright";
  TurnUpright(turns, model);
  for (StagedPhoto* photo : mirrored) StageAsStored(photo);
  return what + "as stored: " +
         (mirrored.empty() ? "both were turned upright"
          : turns.empty()  ? "the photos are used as stored"
                          : "both were turned upright, and mirrored photos are used as stored");
}

}  // namespace regrade
