// The strategies of recipes for COLMAP: the cheapest that works for most captures first, then
// the ones that find poses where it fails, at a price.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"

namespace regrade {

struct PoseRecipe {
  std::string name;
  int max_features = 2048;  // a photo
  int first_octave = 0;     // -1 doubles the picture first: more and finer features
  ColmapLens lens =
      ColmapLens::kOpenCv;     // while the model grows; it is fitted again at the end
  double focal_factor = 1.2;   // first guess of focal length over the longer side, without EXIF
  bool all_pairs = true;       // otherwise each photo with those that follow it
  bool keep_matches = false;   // features and matches of the attempt before
  double init_angle_deg = 16;  // least angle between the rays of the first two photos
  int init_inliers = 100;      // least matches between them
  int min_inliers = 30;        // least points that place a further photo
};

// Photos taken with one lens and one picture size: one camera in the model.
struct CameraGroup {
  int width = 0, height = 0;       // pixels
  double focal_px = 0;             // from EXIF; 0 where unknown
  std::vector<std::string> names;  // staged names
};

// In the order of their first photo. Photos share a camera if size and EXIF focal length agree.
std::vector<CameraGroup> GroupByCamera(const std::vector<StagedPhoto>& photos);

// `all_pairs_up_to`: more photos than this are matched with their neighbours in the order of
// names, except on the last attempt.
std::vector<PoseRecipe> PoseStrategies(const std::vector<StagedPhoto>& photos,
                                       int all_pairs_up_to);

struct ColmapPaths {
  std::string photos, database, image_list, model;
  std::string masks;  // folder; empty: none
};

// The command lines of one recipe. `threads` 0 leaves the number to COLMAP.
ColmapArguments ExtractArguments(const PoseRecipe& recipe, const CameraGroup& group,
                                 int max_image_size, int threads, const ColmapPaths& paths);
std::string MatchCommand(const PoseRecipe& recipe);
ColmapArguments MatchArguments(const PoseRecipe& recipe, int threads, const ColmapPaths& paths);
ColmapArguments MapArguments(const PoseRecipe& recipe, int num_photos, int threads,
                             const ColmapPaths& paths);

}  // namespace regrade
