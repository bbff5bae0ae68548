// What a run will take, estimated before it starts, from sizes and rates that were measured.
//
// A fit's memory peaks where its largest stage writes a checkpoint, or is pruned: values and
// moments of a record of floats a voxel and both packed, or the pruned copy; indices and
// gradients a voxel in each arena; two dense grids of links and densities (12 B) a vertex; 18 B
// for each pixel of the photos (12 B as read, 6 B as rays draw them); and the program itself.
// The first stage stores every vertex; of later ones kStoredShare is stored. Gradients of a
// step are taken to touch each voxel once.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "reconstruct/fit/fit_options.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

// 1.4 M of the 3.4 M vertices of a box of its own shape, at 192 voxels its longest side.
inline constexpr double kStoredShare = 0.4;
inline constexpr double kProgramBytes = 150e6;
// Of two threads, at a grid of kRateResolution a side; a ray's cost grows with the resolution.
inline constexpr double kRaysPerSecond = 105e3;  // 80 to 138 on three captures
inline constexpr double kRateResolution = 160;
inline constexpr double kDeviceSamplesPerSecond =
    4e8;  // of an H200, fit and step together: 270 to 450 on three captures
inline constexpr double kStyleSecondsPerStep = 0.075;  // of two threads
inline constexpr double kPoseSecondsPerPhoto = 2;      // COLMAP's, of two threads
inline constexpr double kTrackSecondsPerPhoto = 0.6;   // likewise, where poses are known

struct StagePlan {
  uint64_t memory = 0;  // bytes at the peak; 0 where it is not planned
  double seconds = 0;
};

// `photo_pixels`: of all photos that are fitted, at working size. A cube, the most, where
// the `box` is not known yet.
StagePlan PlanFit(const FitOptions& options, int64_t photo_pixels, const SceneBox& box,
                  int threads);
// The same on a GPU: values, gradients and moments of a voxel side by side; links, densities
// and distances of a vertex; the coarser grid beside the finer one while it is resampled; 6 B a
// pixel; and the store of samples in flight.
StagePlan PlanFitOnDevice(const FitOptions& options, int64_t photo_pixels, const SceneBox& box);
StagePlan PlanPoses(int64_t photos, int threads);
StagePlan PlanTracks(int64_t photos, int threads);
StagePlan PlanStyle(int64_t steps, int threads);

// "about 1.8 GB of memory and 4 min 12 s"
std::string PlanText(const StagePlan& plan);

// Bytes to plan with: --max-memory in GB of 10^9 bytes or, for 0, `available`.
uint64_t PlannedMemory(double max_memory_gb, uint64_t available);

// Throws Error(kResources), naming the options to lower, if the plan of a fit takes more than
// `limit` bytes of `memory` ("memory", "GPU memory"); a limit of 0 is not known, and none.
void CheckFitsMemory(const StagePlan& plan, uint64_t limit, const char* memory = "memory");

// Lowers the resolutions of the finest stages until the plan takes at most `limit` bytes, to
// kLeastResolution at the least; false if there was nothing to lower. Half the voxels cost a
// decibel or so, a run that fails costs everything.
inline constexpr int kLeastResolution = 64;
bool LowerToMemory(const std::function<StagePlan(const FitOptions&)>& plan_of, uint64_t limit,
                   FitOptions* options);

}  // namespace regrade
