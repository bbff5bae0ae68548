// Masks of an object, one for each photo that has one, and what parts of the style picture
// belong to it.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/scene/image.h"
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
         {.help = "folder of pictures by the photos' names, white where the object is that "
                  "shall be restyled and black elsewhere; grey is a soft edge. They may be "
                  "rough, disagree, or be missing for some photos. Empty restyles the whole "
                  "scene"});
    bind("style-mask", style_mask,
         {.help = "labels of the style picture, one plain colour for each region; the masks "
                  "then have the same colours, each region takes the style of its own, and "
                  "black stays as it is"});
    bind("mask-vote", vote,
         {.help = "share of the photos' votes at which a voxel is half of the object; lower "
                  "reaches further, and believes single masks",
          .min = 0.01,
          .max = 0.99});
    bind("mask-edge", edge,
         {.help = "half the width of the soft edge, in votes; 0 cuts hard",
          .min = 0,
          .max = 0.5});
  }
};

class ObjectMasks {
 public:
  // `photos` are the views' files as the user named them. Throws Error(kInput) for a missing
  // folder, one without a picture of a photo's name, a style mask without colours or with more
  // than kMostRegions.
  ObjectMasks(const MaskOptions& options, const std::vector<std::string>& photos);

  static constexpr int kMostRegions = 16;

  int num_regions() const { return labels_.empty() ? 1 : static_cast<int>(labels_.size()); }
  bool Knows(int view) const { return !paths_[static_cast<size_t>(view)].empty(); }
  int num_known() const;
  // [regions] of [height, width, 1] for a photo of that size. Throws Error(kInput) for a mask
  // of another aspect, and for one that cannot be read.
  std::vector<Image> Coverage(int view, int width, int height) const;
  // The part of the style for a region, of the style picture's size; empty without
  // --style-mask.
  Image StyleRegion(int region, int width, int height) const;

 private:
  std::vector<Image> Regions(const std::string& path, int width, int height) const;

  std::string style_mask_;
  std::vector<std::string> paths_;  // one for each photo; empty where there is none
  std::vector<Vec3f> labels_;       // of the style mask, in order of appearance
};

// Hashes of all that the options name, as part of a stage's inputs.
JsonValue MaskFiles(const MaskOptions& options);

// Makes the paths absolute; Error(kInput) for one that does not exist.
void ProbeMasks(MaskOptions* options);

}  // namespace regrade
