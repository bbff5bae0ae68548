#include "reconstruct/colmap/tracks_for_poses.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/colmap/colmap_output.h"
#include "reconstruct/colmap/colmap_program.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/listed_pairs.h"
#include "reconstruct/colmap/pose_weights.h"
#include "reconstruct/colmap/track_pairs.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kFeatures = 768;        // per photo: give hundreds of tracks
constexpr int kSmallTrackSide = 900;  // pixels; upsamples smaller photos, as in the strategies
// COLMAP's own limit of the reprojection error, pixels ...
constexpr double kStrictLimit = 4;
// ... and ours for inaccurate poses, as a fraction of a photo's longer side.
constexpr double kLooseFraction = 0.01;
constexpr double kLimitOfMedian = 6;  // a limit of this many medians is strict enough
// For verifying matches, lenses with focal lengths within this fraction are the same.
constexpr double kSameFocal = 0.01;

// Photos through one lens, for COLMAP's features.
struct LensGroup {
  ColmapCamera camera;
  CameraGroup photos;
};

bool SameLens(const ColmapCamera& a, const ColmapCamera& b) {
  const auto near = [](double x, double y) { return std::abs(x - y) <= kSameFocal * x; };
  return a.lens == b.lens && a.intrinsics.width == b.intrinsics.width &&
         a.intrinsics.height == b.intrinsics.height && near(a.intrinsics.fx, b.intrinsics.fx) &&
         near(a.intrinsics.fy, b.intrinsics.fy);
}

// A camera's parameters in the format of COLMAP's command line.
std::string ParametersOf(const ColmapCamera& camera) {
  const ColmapLensInfo& info = InfoOf(camera.lens);
  const Camera& c = camera.intrinsics;
  std::string text = Format("%.17g", c.fx);
  if (info.focals == 2) text += Format(",%.17g", c.fy);
  text += Format(",%.17g,%.17g", c.cx, c.cy);
  for (int i = 0; i < info.coefficients; ++i) text += Format(",%.17g", c.distortion[i]);
  return text;
}

class TrackFinder {
 public:
  TrackFinder(const ColmapModel& posed, const std::vector<StagedPhoto>& photos,
              const PoseOptions& options, const std::string& work_folder,
              const ProgressFunction& progress)
      : options_(options),
        work_folder_(fs::absolute(work_folder).string()),
        progress_(progress),
        output_(static_cast<int>(photos.size())),
        began_(ClockSeconds()) {
    std::map<std::string, const StagedPhoto*> by_name;
    for (const StagedPhoto& photo : photos) by_name[photo.name] = &photo;
    for (const ColmapCamera& camera : posed.cameras) start_.cameras.push_back(camera);
    for (const ColmapImage& image : posed.images)
      if (const auto photo = by_name.find(image.name); photo != by_name.end()) {
        start_.images.push_back(image);
        start_.images.back().keypoints.clear();
        photos_.push_back(*photo->second);
      }
    result_.model = posed;
  }

  FoundTracks Find() {
    if (photos_.size() < 2) return result_;
    const std::string start = work_folder_ + "/start", logs = work_folder_ + "/logs";
    fs::remove_all(work_folder_);  // COLMAP would reuse the database of an interrupted run
    fs::create_directories(start);
    fs::create_directories(logs);
    colmap_.emplace(options_.colmap, logs, options_.colmap_gpu);
    result_.colmap_version = colmap_->version();
    PoseStrategy strategy{.max_features = kFeatures};
    strategy.first_octave = LongerSide() < kSmallTrackSide ? -1 : 0;
    const PoseWeights weights = EstimateWeights(strategy, photos_, options_.image_size);
    planned_ = weights.extract + weights.match + weights.refine;
    Extract(strategy, weights.extract);
    Match(weights.match);
    WriteColmapModel(start_, start);
    const double loose = std::max(kStrictLimit, kLooseFraction * LongerSide());
    SetTracks(Triangulate(start, loose, weights.refine / 2));
    // If the poses are accurate, triangulates again with the strict limit.
    if (loose > kStrictLimit && kLimitOfMedian * result_.median_px < loose) {
      const double strict = std::max(kStrictLimit, kLimitOfMedian * result_.median_px);
      SetTracks(Triangulate(start, strict, weights.refine / 2));
    }
    return result_;
  }

 private:
  int LongerSide() const {
    int side = 0;
    for (const StagedPhoto& photo : photos_) side = std::max({side, photo.width, photo.height});
    return side;
  }

  std::vector<LensGroup> GroupByLens() const {
    std::vector<LensGroup> groups;
    for (size_t i = 0; i < photos_.size(); ++i) {
      const ColmapCamera& camera = *start_.FindCamera(start_.images[i].camera_id);
      auto group = std::ranges::find_if(
          groups, [&](const LensGroup& other) { return SameLens(other.camera, camera); });
      if (group == groups.end())
        group = groups.insert(groups.end(),
                              {camera, {photos_[i].width, photos_[i].height, 0, false, {}}});
      group->photos.names.push_back(photos_[i].name);
    }
    return groups;
  }

  void Extract(PoseStrategy strategy, double weight) {
    const std::string list = work_folder_ + "/images.txt";
    for (const LensGroup& group : GroupByLens()) {
      std::ofstream file(list, std::ios::trunc);
      for (const std::string& name : group.photos.names) file << name << "\n";
      file.close();
      strategy.lens = group.camera.lens;
      ColmapArguments arguments =
          ExtractArguments(strategy, group.photos, options_.image_size, options_.threads,
                           {.photos = PhotoFolder(),
                            .database = Database(),
                            .image_list = list,
                            .masks = options_.mask_folder});
      arguments.push_back({"ImageReader.camera_params", ParametersOf(group.camera)});
      RunColmap("feature_extractor", arguments, "features",
                weight * static_cast<double>(group.photos.names.size()) /
                    static_cast<double>(photos_.size()));
    }
  }

  void Match(double weight) {
    std::vector<Camera> cameras;
    for (const ColmapImage& image : start_.images) cameras.push_back(start_.CameraOf(image));
    const auto pairs = PairsToMatch(cameras);
    result_.pairs = static_cast<int>(pairs.size());
    MatchListed(pairs, photos_, Database(), work_folder_ + "/pairs.txt", options_.threads,
                [&](const ColmapArguments& arguments, double fraction) {
                  RunColmap(kListMatcher, arguments, "matching", weight * fraction);
                });
  }

  ColmapModel Triangulate(const std::string& start, double limit_px, double weight) {
    const std::string out = work_folder_ + "/triangulated";
    fs::remove_all(out);
    fs::create_directories(out);
    const std::string limit = Format("%g", limit_px);
    // With clear_points, images get the database's ids, by name.
    RunColmap("point_triangulator",
              {{"database_path", Database()},
               {"image_path", PhotoFolder()},
               {"input_path", start},
               {"output_path", out},
               {"clear_points", "1"},
               {"Mapper.num_threads", Threads()},
               {"Mapper.ba_global_function_tolerance", "1e-6"},
               {"Mapper.filter_max_reproj_error", limit},
               {"Mapper.tri_complete_max_reproj_error", limit},
               {"Mapper.tri_merge_max_reproj_error", limit}},
              "triangulating points", weight);
    try {
      return ReadColmapModel(out);
    } catch (const Error& error) {
      throw ProgramError(
          "colmap point_triangulator wrote no readable model: " + error.what_failed(),
          colmap_->log_folder());
    }
  }

  // Copies keypoints and points of COLMAP's model, with our image ids.
  void SetTracks(const ColmapModel& found) {
    std::map<std::string, ColmapImage*> by_name;
    for (ColmapImage& image : result_.model.images) {
      image.keypoints.clear();
      by_name[image.name] = &image;
    }
    std::map<uint32_t, uint32_t> id_of;
    for (const ColmapImage& image : found.images)
      if (const auto own = by_name.find(image.name); own != by_name.end()) {
        own->second->keypoints = image.keypoints;
        id_of[image.id] = own->second->id;
      }
    result_.model.points = found.points;
    for (ColmapPoint& point : result_.model.points)
      for (ColmapTrackElement& element : point.track)
        element.image_id = id_of.at(element.image_id);
    std::vector<double> errors;
    for (const ColmapImage& image : result_.model.images) {
      const Camera camera = result_.model.CameraOf(image);
      for (const ColmapKeypoint& keypoint : image.keypoints) {
        const ColmapPoint* const point = result_.model.FindPoint(keypoint.point_id);
        double u = 0, v = 0;
        if (point != nullptr && camera.Project(point->position, &u, &v))
          errors.push_back(std::hypot(u - keypoint.u, v - keypoint.v));
      }
    }
    result_.observations = std::ssize(errors);
    result_.median_px = Median(std::move(errors));
  }

  void RunColmap(const std::string& command, const ColmapArguments& arguments,
                 const std::string& what, double weight) {
    output_.StartCommand();
    const double n = static_cast<double>(photos_.size());
    const double allowed =
        options_.time_limit_min > 0 ? 60 * options_.time_limit_min : 600 + 60 * n;
    const double spent = ClockSeconds() - began_;
    const ChildResult result = colmap_->Run(
        command, arguments, command,
        {std::max(1.0, allowed - spent), 60 * options_.quiet_limit_min},
        [&](const std::string& line) { output_.Line(line); },
        [&] {
          return Report(progress_, std::min(spent_ + weight * output_.fraction(), planned_),
                        planned_, what + " (for given poses)") != LoopControl::kStop;
        });
    spent_ += weight;
    if (!result.Succeeded()) colmap_->Fail(command, result, command);
  }

  std::string PhotoFolder() const {
    return fs::absolute(fs::path(photos_.front().path).parent_path()).string();
  }
  std::string Database() const { return work_folder_ + "/database.db"; }
  std::string Threads() const {
    return std::to_string(options_.threads > 0 ? options_.threads : -1);
  }

  const PoseOptions& options_;
  const std::string work_folder_;
  const ProgressFunction& progress_;
  ColmapOutput output_;
  const double began_;
  std::vector<StagedPhoto> photos_;  // of start_.images
  ColmapModel start_;                // images that have a photo
  FoundTracks result_;
  std::optional<ColmapProgram> colmap_;
  double spent_ = 0, planned_ = 1;  // estimated seconds
};

}  // namespace

FoundTracks TracksForPoses(const ColmapModel& posed, const std::vector<StagedPhoto>& photos,
                           const PoseOptions& options, const std::string& work_folder,
                           const ProgressFunction& progress) {
  return TrackFinder(posed, photos, options, work_folder, progress).Find();
}

}  // namespace regrade
