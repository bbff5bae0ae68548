// --masks: masks of an object in the photos, and the regions of the style picture that belong
// to them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/json_file.h"

namespace regrade {

struct MaskOptions {
  std::string masks;
  std::string style_mask;
  double vote = 0.5;
  double edge = 0.25;

  bool On() const { return !masks.empty(); }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("masks", masks,
         {.help = "folder of masks by the photos' names: white for the object to restyle, "
                  "black elsewhere, grey for soft edges. They may be rough, disagree, or be "
                  "missing for some photos. Empty restyles the whole scene",
          .reads = "*"});
    bind("style-mask", style_mask,
         {.help = "labels of the style picture, one plain colour per region; masks then use "
                  "the same colours, each region gets the style of its label, and black stays "
                  "unchanged",
          .reads = "*"});
    bind("mask-vote", vote,
         {.help = "fraction of the photos' votes at which a voxel has object weight 0.5; "
                  "lower values extend the object and rely on fewer masks",
          .min = 0.01,
          .max = 0.99,
          .constant = true});
    bind("mask-edge", edge,
         {.unit = "fraction of votes",
          .help = "half the width of the object's soft edge; 0 makes a hard edge",
          .min = 0,
          .max = 0.5,
          .constant = true});
  }
};

class ObjectMasks {
 public:
  // `photos`: the user's names of the views' files. Throws Error(kInput) for a missing
  // folder, one without a picture of a photo's name, a style mask without colours or with more
  // than kMostRegions.
  // With `views` the masks are as its cameras see them, see WorkingViews::AsSeen.
  ObjectMasks(const MaskOptions& options, const std::vector<std::string>& photos,
              std::optional<WorkingViews> views = {});

  static constexpr int kMostRegions = 16;

  int num_regions() const { return labels_.empty() ? 1 : static_cast<int>(labels_.size()); }
  bool Knows(int view) const { return !paths_[view].empty(); }
  int num_known() const;
  // [regions] of [height, width, 1] for a photo of that size. Throws Error(kInput) for a mask
  // of another aspect, and for one that cannot be read.
  std::vector<Image> Coverage(int view, int width, int height) const;
  // The part of the style for a region, of the style picture's size; empty without
  // --style-mask.
  Image StyleRegion(int region, int width, int height) const;

 private:
  std::vector<Image> Regions(const std::string& path, int width, int height) const;

  std::optional<WorkingViews> views_;
  std::string style_mask_;
  std::vector<std::string> paths_;  // one for each photo; empty without a mask
  std::vector<Vec3f> labels_;       // of the style mask, in order of appearance
};

// Hashes of the files that the options name, as part of a stage's inputs.
JsonValue MaskFiles(const MaskOptions& options);

// Makes the paths absolute. Throws Error(kInput) for one that does not exist.
void ProbeMasks(MaskOptions* options);

}  // namespace regrade
