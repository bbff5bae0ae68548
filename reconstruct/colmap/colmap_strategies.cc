#include "reconstruct/colmap/colmap_strategies.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "reconstruct/colmap/listed_pairs.h"
#include "reconstruct/colmap/place_pairs.h"

namespace regrade {
namespace {

constexpr int kOverlap = 10;   // neighbours on each side, when not all pairs are matched
constexpr int kBlockSize = 8;  // photos per block: COLMAP prints a line for at most 64 pairs
// Photos with a shorter longer side have few features at their original size.
constexpr int kSmallSide = 900;
// With fewer photos, four distortion coefficients are underdetermined while the model is small.
constexpr size_t kFewPhotos = 20;
// Up to this many photos, more features cost little, and the finer ones are more accurate: on
// strecha/fountain-P11 they reduce the rotation error from 0.17 to 0.05 degrees.
constexpr size_t kFewPairs = 15;
// The cost of matching all pairs grows with the square.
constexpr size_t kMostForAllPairs = 150;
// Each of many photos is matched with so many that look most like it.
constexpr int kSimilarPhotos = 20;
// With more photos than this, fewer features are matched: the cost of a pair grows with their
// square. 30 pairs a photo at 2048 features, .23 s each, would be two hours for 1000 photos.
constexpr size_t kVeryMany = 500;
constexpr int kFeaturesOfVeryMany = 1024;
// The vocabulary is learned from the features of so many photos, in a tree of so many branches:
// COLMAP's 65536 words of all photos in a tree of 256 take one thread far longer.
constexpr int kPhotosOfVocabulary = 100, kVisualWords = 8192, kBranches = 32, kRounds = 5,
              kBranchChecks = 64;

std::string Text(double value) { return Format("%.9g", value); }

Pairing PairingOf(const std::vector<StagedPhoto>& photos, size_t all_pairs_up_to) {
  if (photos.size() <= all_pairs_up_to) return Pairing::kAll;
  if (HasClips(photos)) return Pairing::kListed;
  if (photos.size() <= kMostForAllPairs) return Pairing::kOrder;
  return PlacesTellPhotosApart(photos) ? Pairing::kListed : Pairing::kSimilar;
}

}  // namespace

std::vector<CameraGroup> GroupByCamera(const std::vector<StagedPhoto>& photos) {
  std::vector<CameraGroup> groups;
  for (const StagedPhoto& photo : photos) {
    const auto same = [&](const CameraGroup& group) {
      return group.width == photo.width && group.height == photo.height &&
             group.focal_px == photo.exif_focal_px && group.film == (photo.clip >= 0);
    };
    auto it = std::ranges::find_if(groups, same);
    if (it == groups.end())
      it = groups.insert(groups.end(),
                         {photo.width, photo.height, photo.exif_focal_px, photo.clip >= 0, {}});
    it->names.push_back(photo.name);
  }
  return groups;
}

std::vector<PoseStrategy> PoseStrategies(const std::vector<StagedPhoto>& photos,
                                         int all_pairs_up_to) {
  int side = 0;
  for (const StagedPhoto& photo : photos) side = std::max({side, photo.width, photo.height});
  const bool simple_lens = photos.size() < kFewPhotos || GroupByCamera(photos).size() > 1;

  PoseStrategy quick{.name = "quick"};
  if (photos.size() <= kFewPairs) quick.max_features = 4096;
  const bool very_many = photos.size() > kVeryMany;
  if (very_many) quick.max_features = kFeaturesOfVeryMany;
  quick.first_octave = (side < kSmallSide && !very_many) || photos.size() <= kFewPairs ? -1 : 0;
  quick.lens = simple_lens ? ColmapLens::kSimpleRadial : ColmapLens::kOpenCv;
  quick.pairing = PairingOf(photos, static_cast<size_t>(all_pairs_up_to));

  PoseStrategy finer = quick;
  finer.name = "more features";
  finer.max_features = very_many ? 2 * kFeaturesOfVeryMany : 8192;
  finer.first_octave = -1;

  PoseStrategy relaxed = finer;
  relaxed.name = "narrower first pair";
  relaxed.keep_matches = true;
  relaxed.init_angle_deg = 5;
  relaxed.init_inliers = 50;
  relaxed.min_inliers = 20;

  PoseStrategy thorough = relaxed;
  thorough.name = "all pairs, wider lens";
  thorough.keep_matches = false;
  thorough.max_features = quick.pairing == Pairing::kAll ? 8192 : 4096;
  if (photos.size() <= kMostForAllPairs) thorough.pairing = Pairing::kAll;
  thorough.lens = ColmapLens::kSimpleRadial;
  thorough.focal_factor = 0.75;
  return {quick, finer, relaxed, thorough};
}

ColmapArguments ExtractArguments(const PoseStrategy& strategy, const CameraGroup& group,
                                 int max_image_size, int threads, const ColmapPaths& paths) {
  ColmapArguments arguments = {
      {"database_path", paths.database},
      {"image_path", paths.photos},
      {"image_list_path", paths.image_list},
      {"ImageReader.single_camera", "1"},
      {"ImageReader.camera_model", ColmapLensName(strategy.lens)},
      {"ImageReader.default_focal_length_factor", Text(strategy.focal_factor)},
      {"SiftExtraction.use_gpu", "0"},
      {"SiftExtraction.num_threads", std::to_string(threads > 0 ? threads : -1)},
      {"SiftExtraction.max_image_size", std::to_string(max_image_size)},
      {"SiftExtraction.max_num_features", std::to_string(strategy.max_features)},
      {"SiftExtraction.first_octave", std::to_string(strategy.first_octave)},
  };
  if (!paths.masks.empty()) arguments.push_back({"ImageReader.mask_path", paths.masks});
  if (group.focal_px > 0) {
    const std::string f = Text(group.focal_px);
    std::string parameters = strategy.lens == ColmapLens::kOpenCv ? f + "," + f : f;
    parameters += "," + Text(group.width / 2.0) + "," + Text(group.height / 2.0);
    parameters += strategy.lens == ColmapLens::kOpenCv ? ",0,0,0,0" : ",0";
    arguments.push_back({"ImageReader.camera_params", parameters});
  }
  return arguments;
}

std::vector<MatchStep> MatchSteps(const PoseStrategy& strategy, int threads,
                                  const ColmapPaths& paths) {
  const ColmapArguments common = {
      {"database_path", paths.database},
      {"SiftMatching.use_gpu", "0"},
      {"SiftMatching.num_threads", std::to_string(threads > 0 ? threads : -1)},
  };
  const auto with = [&common](ColmapArguments more) {
    more.insert(more.begin(), common.begin(), common.end());
    return more;
  };
  if (strategy.pairing == Pairing::kAll)
    return {{"exhaustive_matcher",
             with({{"ExhaustiveMatching.block_size", std::to_string(kBlockSize)}})}};
  const MatchStep in_order = {"sequential_matcher",
                              with({{"SequentialMatching.overlap", std::to_string(kOverlap)}})};
  if (strategy.pairing == Pairing::kOrder) return {in_order};
  REGRADE_CHECK(strategy.pairing == Pairing::kSimilar);
  return {{in_order.command, in_order.arguments, 0.3},
          {"vocab_tree_builder",
           {{"database_path", paths.database},
            {"vocab_tree_path", paths.vocabulary},
            {"num_visual_words", std::to_string(kVisualWords)},
            {"branching", std::to_string(kBranches)},
            {"num_iterations", std::to_string(kRounds)},
            {"num_checks", std::to_string(kBranchChecks)},
            {"max_num_images", std::to_string(kPhotosOfVocabulary)}},
           0.1},
          {"vocab_tree_matcher",
           with({{"VocabTreeMatching.vocab_tree_path", paths.vocabulary},
                 {"VocabTreeMatching.num_images", std::to_string(kSimilarPhotos)}}),
           0.6}};
}

ColmapArguments MapArguments(const PoseStrategy& strategy, int num_photos, int threads,
                             const ColmapPaths& paths) {
  return {
      {"database_path", paths.database},
      {"image_path", paths.photos},
      {"output_path", paths.model},
      {"Mapper.num_threads", std::to_string(threads > 0 ? threads : -1)},
      // With the defaults of 0 every bundle adjustment runs to its iteration limit. These
      // values give the same poses in two thirds of the time.
      {"Mapper.ba_local_function_tolerance", "1e-6"},
      {"Mapper.ba_global_function_tolerance", "1e-6"},
      // COLMAP silently drops smaller models; its default would drop small captures.
      {"Mapper.min_model_size", std::to_string(std::clamp(num_photos / 4, 3, 10))},
      {"Mapper.init_min_tri_angle", Text(strategy.init_angle_deg)},
      {"Mapper.init_min_num_inliers", std::to_string(strategy.init_inliers)},
      {"Mapper.abs_pose_min_num_inliers", std::to_string(strategy.min_inliers)},
  };
}

}  // namespace regrade
