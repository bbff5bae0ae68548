// What a run will take, estimated before it starts, from sizes and rates that were measured.
//
// A fit's memory peaks at its last pruning or at its largest stage: values, moments and the
// pruned copy of a record of floats a voxel; indices and gradients a voxel in each arena; two
// dense grids of links (4 B), densities (4 B) and distances (1 B) a vertex; 18 B for each pixel
// of the photos (12 B as read, 6 B as rays draw them). The first stage stores every vertex; of
// later ones kStoredShare is stored. Gradients of a step are taken to touch each voxel once.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/base/vec.h"
#include "reconstruct/fit_options.h"

namespace regrade {

// 1.3 M of 7.1 M vertices at 192^3 on real captures, rounded up.
inline constexpr double kStoredShare = 0.2;
// Of two threads, at a grid of kRateResolution a side; a ray's cost grows with the resolution.
inline constexpr double kRaysPerSecond = 105e3;  // 80 to 138 on three captures
inline constexpr double kRateResolution = 160;
inline constexpr double kStyleSecondsPerStep = 0.075;  // of two threads
inline constexpr double kPoseSecondsPerPhoto = 2;    // COLMAP's, of two threads

struct StagePlan {
  uint64_t memory = 0;  // bytes at the peak; 0 where it is not planned
  double seconds = 0;
};

// `photo_pixels`: of all photos that are fitted, at working size. `box_radius`: half sides of
// the scene's box; (1, 1, 1), the most, where it is not known yet.
StagePlan PlanFit(const FitOptions& options, int64_t photo_pixels, const Vec3f& box_radius,
                  int threads);
StagePlan PlanPoses(int64_t photos, int threads);
StagePlan PlanStyle(int64_t steps, int threads);

// "about 1.8 GB of memory and 4 min 12 s"
std::string PlanText(const StagePlan& plan);

// Bytes to plan with: --max-memory in GB of 10^9 bytes or, for 0, `available`.
uint64_t PlannedMemory(double max_memory_gb, uint64_t available);

// Throws Error(kResources), naming the options to lower, if the plan of a fit takes more than
// `limit` bytes; a limit of 0 is not known, and none.
void CheckFitsMemory(const StagePlan& plan, uint64_t limit);

}  // namespace regrade
