// COLMAP strategies, cheapest first: the first one works for most captures, the others for the
// rest at a higher cost.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"

namespace regrade {

struct PoseStrategy {
  std::string name;
  int max_features = 2048;  // per photo
  int first_octave = 0;     // -1 upsamples the photo by 2: more and finer features
  ColmapLens lens = ColmapLens::kOpenCv;  // of the mapper; the final lens is fitted later
  double focal_factor = 1.2;   // initial focal length over the longer side, without EXIF
  bool all_pairs = true;       // otherwise each photo with its successors ...
  bool by_list = false;        // ... or, of films, the pairs of listed_pairs.h
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

// With more than `all_pairs_up_to` photos, each is matched with its neighbours in the order of
// names, except in the last strategy; frames of films by the list of listed_pairs.h.
std::vector<PoseStrategy> PoseStrategies(const std::vector<StagedPhoto>& photos,
                                         int all_pairs_up_to);

struct ColmapPaths {
  std::string photos, database, image_list, model;
  std::string masks;  // folder; empty: none
};

// The command lines of one strategy. `threads` 0: COLMAP chooses.
ColmapArguments ExtractArguments(const PoseStrategy& strategy, const CameraGroup& group,
                                 int max_image_size, int threads, const ColmapPaths& paths);
std::string MatchCommand(const PoseStrategy& strategy);
ColmapArguments MatchArguments(const PoseStrategy& strategy, int threads,
                               const ColmapPaths& paths);
ColmapArguments MapArguments(const PoseStrategy& strategy, int num_photos, int threads,
                             const ColmapPaths& paths);

}  // namespace regrade
