// COLMAP strategies, cheapest first: the first one works for most captures, the others for the
// rest at a higher cost.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"

namespace regrade {

// Which photos are matched with which.
enum class Pairing {
  kAll,     // all with all
  kOrder,   // each with its neighbours in the order of names
  kListed,  // the pairs of PairsOfClips or PairsOfPlaces
  kSimilar  // as kOrder, and each with those that look most like it, by a vocabulary tree
};

struct PoseStrategy {
  std::string name;
  int max_features = 2048;  // per photo
  int first_octave = 0;     // -1 upsamples the photo by 2: more and finer features
  ColmapLens lens = ColmapLens::kOpenCv;  // of the mapper; the final lens is fitted later
  double focal_factor = 1.2;  // initial focal length over the longer side, without EXIF
  Pairing pairing = Pairing::kAll;
  bool keep_matches = false;   // reuse features and matches of the previous attempt
  double init_angle_deg = 16;  // least angle between the rays of the first two photos
  int init_inliers = 100;      // least matches between them
  int min_inliers = 30;        // least points to register a further photo
};

// Photos taken with one lens and one picture size: one camera in the model.
struct CameraGroup {
  int width = 0, height = 0;       // pixels
  double focal_px = 0;             // from EXIF; 0 where unknown
  bool film = false;               // frames of films
  std::vector<std::string> names;  // staged names
};

// In the order of their first photo. Photos share a camera if size and EXIF focal length agree;
// frames of films, which a camera crops, share none with photos.
std::vector<CameraGroup> GroupByCamera(const std::vector<StagedPhoto>& photos);

// Up to `all_pairs_up_to` photos are matched all with all; frames of films, and many photos
// that know their places, by a list; others in the order of names, and many of them by
// likeness, too. The last strategy takes all pairs where they are not too many.
std::vector<PoseStrategy> PoseStrategies(const std::vector<StagedPhoto>& photos,
                                         int all_pairs_up_to);

struct ColmapPaths {
  std::string photos, database, image_list, model, vocabulary;
  std::string masks;  // folder; empty: none
};

// The command lines of one strategy. `threads` 0: COLMAP chooses.
ColmapArguments ExtractArguments(const PoseStrategy& strategy, const CameraGroup& group,
                                 int max_image_size, int threads, const ColmapPaths& paths);
// For listed pairs MatchListed runs the commands instead.
struct MatchStep {
  std::string command;
  ColmapArguments arguments;
  double weight = 1;  // fraction of the time
};
std::vector<MatchStep> MatchSteps(const PoseStrategy& strategy, int threads,
                                  const ColmapPaths& paths);
ColmapArguments MapArguments(const PoseStrategy& strategy, int num_photos, int threads,
                             const ColmapPaths& paths);

}  // namespace regrade
