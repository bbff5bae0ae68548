// Memory and time of a run, estimated before it starts from sizes and measured rates.
//
// A fit's memory peaks when its largest stage is pruned: per voxel a record of floats, its
// moments, its gradients and the pruned copy, the weights of each thread, indices of each
// arena; per vertex two dense grids of links and densities (12 B); 18 B per photo pixel (12 B
// as read, 6 B as drawn by rays); and the program itself. The first stage stores every vertex,
// later ones the fraction kStoredFraction. A step's gradients are assumed to touch each voxel
// once. Less is needed to write a checkpoint or a field (nothing per voxel), to continue from a
// checkpoint (its file besides values and moments), and to read a field: 4 + 12 basis B per
// voxel that it keeps, and 58 of the file's arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "reconstruct/fit/fit_options.h"
#include "reconstruct/scene/scene_box.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "stylize/training/train_network_options.h"

namespace regrade {

inline constexpr double kProgramBytes = 150e6;
inline constexpr double kPoseSecondsPerPhoto = 2;     // COLMAP, with two threads
inline constexpr double kTrackSecondsPerPhoto = 0.6;  // likewise, with known poses

struct StagePlan {
  uint64_t memory = 0;  // bytes at the peak; 0 if not planned
  double seconds = 0;
};

// Pixels of the photos that are fitted, at working size, before any is read: of `photos` every
// `holdout`-th is kept out, as in HeldOutViews, and all are taken for 4:3 and no smaller.
int64_t ExpectedPixels(int64_t photos, int photo_size, int holdout);

// Voxels that a stage stores: a part of its grid's vertices, at most max_voxels.
double PlannedVoxels(const FitOptions& options, const SceneBox& box, size_t stage);
// `photo_pixels`: of all fitted photos, at working size. A cube, the upper bound, for a `box`
// that is not known yet.
StagePlan PlanFit(const FitOptions& options, int64_t photo_pixels, const SceneBox& box,
                  int threads);
// On a GPU: values, gradients and moments per voxel; links, densities and distances per vertex;
// the coarser grid beside the finer one during resampling; 6 B per pixel; and the buffer of
// samples in flight.
StagePlan PlanFitOnDevice(const FitOptions& options, int64_t photo_pixels, const SceneBox& box);
// Of splats. On a CPU a splat is taken to have 6 entries, on a card 11; a step's time grows
// with the photo's pixels and, half of the most on average, with the splats. `one_by_one`:
// photos are decoded so, and not kept as they were.
StagePlan PlanSplatFit(const SplatFitOptions& options, int64_t photo_pixels, int64_t photos,
                       int threads, bool one_by_one = false);
StagePlan PlanSplatFitOnDevice(const SplatFitOptions& options, int64_t photo_pixels,
                               int64_t photos);
StagePlan PlanPoses(int64_t photos, int threads);
StagePlan PlanTracks(int64_t photos, int threads);
// What a fit stores: records of voxels or splats, and the vertices of the grid that links to
// them.
struct PlannedField {
  double records = 0, vertices = 0;
  int basis = 1;
};
PlannedField PlanField(const FitOptions& options, const SceneBox& box);
PlannedField PlanField(const SplatFitOptions& options);
// `view_pixels`: of each of `photos` at working size, which are a step's rays where
// rays_per_step is 0. More rays share voxels, so that time grows by their number to the power
// kStyleRateGrowth. In memory are the field, the photos' targets, and of what a step's rays
// touch the colours, their gradients, and a batch of features.
StagePlan PlanStyle(const TrainNetworkOptions& options, const PlannedField& field,
                    double view_pixels, double photos, int threads);

// "about 1.8 GB of memory and 4 min 12 s"
std::string PlanText(const StagePlan& plan);

// Bytes to plan with: --max-memory in GB of 10^9 bytes or, for 0, `available`.
uint64_t PlannedMemory(double max_memory_gb, uint64_t available);

// Throws Error(kResources), naming the options to lower, if the plan of a fit takes more than
// `limit` bytes of `memory` ("memory", "GPU memory"). A limit of 0 is unknown and not checked.
void CheckFitsMemory(const StagePlan& plan, uint64_t limit, const char* memory = "memory");

}  // namespace regrade
