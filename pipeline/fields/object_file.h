// object.npz: f32 "weights" [regions, voxels] in [0, 1], the object weights of a style that is
// limited to masks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/fields/kept_records.h"

namespace regrade {

inline constexpr int kMostObjectRegions = 16;

// Object weights [voxels] of each region, and their sum, at most 1.
struct ObjectWeights {
  std::vector<std::vector<float>> regions;
  std::vector<float> all;
};

std::vector<float> SumOfRegions(const std::vector<std::vector<float>>& regions);

// Throws Error(kResources).
void WriteObjectFile(const std::string& path, const ObjectWeights& weights);

// Those of `records`. Throws Error(kInput) for a file that is damaged, newer, or has another
// number of voxels than the field's file.
ObjectWeights ReadObjectFile(const std::string& path, const KeptRecords& records);

}  // namespace regrade
