// object.npz: f32 "weights" [regions, voxels] in [0, 1], the object weights of a style that is
// limited to masks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

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

// Throws Error(kInput) for a file that is damaged, newer, or does not fit `voxels`.
ObjectWeights ReadObjectFile(const std::string& path, int64_t voxels);

}  // namespace regrade
