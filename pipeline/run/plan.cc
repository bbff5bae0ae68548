#include "pipeline/run/plan.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/spherical_harmonics.h"
#include "pipeline/files/text.h"
#include "reconstruct/fit/resample_grid.h"
#include "stylize/field/network_row.h"

namespace regrade {
namespace {

// 1.4 M of 3.4 M vertices, of a box fitted to its scene, at 192 voxels on the longest side.
constexpr double kStoredFraction = 0.4;
// With two threads, at a grid of kRateResolution a side; a ray's cost grows with the
// resolution.
constexpr double kRaysPerSecond = 105e3;  // 80 to 138 on three captures
constexpr double kRateResolution = 160;
constexpr double kDeviceSamplesPerSecond =
    1e8;  // of an H200, with all that a step does: 54 to 119 with the paper's schedules
// With two threads, of a step of kStyleRateRays; of more rays, see PlanStyle.
constexpr double kStyleSecondsPerStep = 0.075;
constexpr double kStyleRateRays = 4096;
constexpr double kStyleRateGrowth = 0.8;  // whole views of 270x480 take 353 s, not 20

constexpr double kGridBytes = 4 + 8;     // per vertex: link, and density with link again
constexpr double kPixelBytes = 12 + 6;   // floats as read, 16 bits a channel as drawn
constexpr double kSphereFraction = 0.6;  // of a map's texels are visible in photos
constexpr double kIndexBytes = 4;        // vertex of a voxel, slot of a voxel, and back
constexpr double kWeightBytes = 4;       // of a voxel, in each thread

// Rates are for two threads.
double SecondsWith(double seconds, int threads) { return seconds * 2 / std::max(threads, 1); }

double VerticesOf(const FitOptions& options, const SceneBox& box, size_t stage) {
  const Vec3i n = GridOfStage(options, box, stage);
  return static_cast<double>(n.x) * n.y * n.z;
}

std::string MemoryText(double bytes) {
  return bytes < 1e8 ? Format("%.0f MB", bytes * 1e-6) : Format("%.1f GB", bytes * 1e-9);
}

}  // namespace

int64_t ExpectedPixels(int64_t photos, int photo_size, int holdout) {
  const int64_t held_out = holdout > 0 ? (photos + holdout - 1) / holdout : 0;
  return (photos - held_out) * photo_size * photo_size * 3 / 4;
}

double PlannedVoxels(const FitOptions& options, const SceneBox& box, size_t stage) {
  const double stored = VerticesOf(options, box, stage) * (stage == 0 ? 1 : kStoredFraction);
  const double most = double{options.max_voxels} * 1e6;
  return most > 0 ? std::min(stored, most) : stored;
}

StagePlan PlanFit(const FitOptions& options, int64_t photo_pixels, const SceneBox& box,
                  int threads) {
  const double record = 4.0 * RecordLanes(BasisOfDegree(options.sh_degree));
  const int arenas = options.shards > 0 ? options.shards : std::max(threads, 1);
  double field = 0, seconds = 0;
  for (size_t s = 0; s < options.resolutions.size(); ++s) {
    const double voxels = PlannedVoxels(options, box, s),
                 vertices = VerticesOf(options, box, s);
    const double gradients = record + kIndexBytes + arenas * kIndexBytes;
    const double pruning = record + threads * kWeightBytes;
    field = std::max(field, voxels * (2 * record + kIndexBytes + gradients + pruning) +
                                vertices * 2 * kGridBytes);
    const double rays = static_cast<double>(options.steps[s]) * options.rays_per_step;
    seconds += rays / kRaysPerSecond * options.resolutions[s] / kRateResolution;
  }
  if (box.far_surroundings) {
    // Values, moments, gradients and a resampled copy, 16 bytes each; a slot in each arena.
    // Time is about the same: the ball has fewer voxels than the box.
    const double map = 2.0 * options.background_resolution * options.background_resolution;
    field += map * (kIndexBytes + kSphereFraction * options.background_layers *
                                      (4 * 16 + arenas * kIndexBytes));
  }
  const double photos = static_cast<double>(photo_pixels) * kPixelBytes;
  return {static_cast<uint64_t>(kProgramBytes + field + photos), SecondsWith(seconds, threads)};
}

StagePlan PlanFitOnDevice(const FitOptions& options, int64_t photo_pixels,
                          const SceneBox& box) {
  constexpr double kSampleStore = 1 << 30, kVertexBytes = 4 + 4 + 1 + 1, kSamplesPerRay = 40,
                   kExactSumsSlower = 2;
  const double record = 4.0 * RecordLanes(BasisOfDegree(options.sh_degree));
  double peak = 0, coarser = 0, seconds = 0;
  for (size_t s = 0; s < options.resolutions.size(); ++s) {
    const double voxels = PlannedVoxels(options, box, s),
                 vertices = VerticesOf(options, box, s);
    // Values, gradients, moments; exact sums are twice as wide.
    const double field = voxels * ((options.exact_sums ? 4 : 3) * record + kIndexBytes) +
                         vertices * kVertexBytes;
    // No samples are stored during resampling, which needs marks and ranks of vertices.
    peak = std::max(peak, field + coarser + kSampleStore);
    coarser = field + 4 * voxels;  // with weights, which decide what is kept
    seconds += static_cast<double>(options.steps[s]) * options.rays_per_step * kSamplesPerRay /
               kDeviceSamplesPerSecond;
  }
  if (box.far_surroundings) {  // values, gradients and moments
    const double map = 2.0 * options.background_resolution * options.background_resolution;
    peak += map * (kIndexBytes + kSphereFraction * options.background_layers *
                                     (options.exact_sums ? 4 : 3) * 16);
  }
  if (options.exact_sums) seconds *= kExactSumsSlower;
  return {static_cast<uint64_t>(peak + 6.0 * static_cast<double>(photo_pixels)), seconds};
}

namespace {

// Values and Adam's moments.
double SplatStateBytes(const SplatFitOptions& options) {
  return 3 * 4.0 * (11 + 3 * BasisOfDegree(options.sh_degree));
}

// Of all steps, with seconds for a pixel of a photo and for a splat of a step.
double SplatSeconds(const SplatFitOptions& options, int64_t photo_pixels, int64_t photos,
                    double of_pixel, double of_splat) {
  const double pixels =
      static_cast<double>(photo_pixels) / static_cast<double>(std::max<int64_t>(photos, 1));
  const double part = 1 - 0.75 * double{options.small_until};  // steps at half size
  return options.steps * (1 - double{options.begin}) *
         (of_pixel * pixels * part + of_splat * 500.0 * double{options.thousands});
}

}  // namespace

StagePlan PlanSplatFit(const SplatFitOptions& options, int64_t photo_pixels, int64_t photos,
                       int threads, bool one_by_one) {
  constexpr double kEntries = 6, kEntryBytes = 12 + 48, kSeenBytes = 100, kThreadBytes = 8e6,
                   kOfPixel = 500e-9, kOfSplat = 400e-9;
  const double of_photo = one_by_one ? 7 : 12 + 8;  // bytes of a pixel
  const double splats = 1000.0 * double{options.thousands};
  const double bytes =
      splats * (SplatStateBytes(options) + kSeenBytes + kEntries * kEntryBytes);
  return {
      static_cast<uint64_t>(kProgramBytes + kThreadBytes * threads + bytes +
                            of_photo * static_cast<double>(photo_pixels)),
      SecondsWith(SplatSeconds(options, photo_pixels, photos, kOfPixel, kOfSplat), threads)};
}

StagePlan PlanSplatFitOnDevice(const SplatFitOptions& options, int64_t photo_pixels,
                               int64_t photos) {
  constexpr double kEntries = 11, kEntryBytes = 24 + 88, kSeenBytes = 104, kPhotoBytes = 6,
                   kLeast = 300e6, kOfPixel = 1.5e-9, kOfSplat = 3e-9;
  const double splats = 1000.0 * double{options.thousands};
  const double bytes =
      splats * (SplatStateBytes(options) + kSeenBytes + kEntries * kEntryBytes);
  return {
      static_cast<uint64_t>(kLeast + bytes + kPhotoBytes * static_cast<double>(photo_pixels)),
      SplatSeconds(options, photo_pixels, photos, kOfPixel, kOfSplat)};
}

StagePlan PlanPoses(int64_t photos, int threads) {
  return {0, SecondsWith(kPoseSecondsPerPhoto * static_cast<double>(photos), threads)};
}

StagePlan PlanTracks(int64_t photos, int threads) {
  return {0, SecondsWith(kTrackSecondsPerPhoto * static_cast<double>(photos), threads)};
}

PlannedField PlanField(const FitOptions& options, const SceneBox& box) {
  const size_t last = options.resolutions.size() - 1;
  return {PlannedVoxels(options, box, last), VerticesOf(options, box, last),
          BasisOfDegree(options.sh_degree)};
}

PlannedField PlanField(const SplatFitOptions& options) {
  return {1000.0 * double{options.thousands}, 0, BasisOfDegree(options.sh_degree)};
}

StagePlan PlanStyle(const TrainNetworkOptions& options, const PlannedField& field,
                    double view_pixels, double photos, int threads) {
  constexpr double kTouchedByRay = 250, kTargetBytes = 12;
  const double rays = options.rays_per_step > 0 ? options.rays_per_step : view_pixels;
  const double step =
      kStyleSecondsPerStep * std::pow(std::max(1.0, rays / kStyleRateRays), kStyleRateGrowth);
  const double row = 4.0 * RowOf(field.basis).stride(),
               touched = std::min(field.records, kTouchedByRay * rays),
               batch = std::min(touched, static_cast<double>(options.loss.batch));
  const double bytes = field.records * (4.0 * RecordLanes(field.basis) + 2 * kIndexBytes) +
                       field.vertices * kGridBytes + row * (2 * touched + batch) +
                       kTargetBytes * view_pixels * photos;
  return {static_cast<uint64_t>(kProgramBytes + bytes),
          SecondsWith(step * options.steps, threads)};
}

std::string PlanText(const StagePlan& plan) {
  const std::string time = DurationText(plan.seconds);
  if (plan.memory == 0) return "about " + time;
  return "about " + MemoryText(static_cast<double>(plan.memory)) + " of memory and " + time;
}

uint64_t PlannedMemory(double max_memory_gb, uint64_t available) {
  return max_memory_gb > 0 ? static_cast<uint64_t>(max_memory_gb * 1e9) : available;
}

void CheckFitsMemory(const StagePlan& plan, uint64_t limit, const char* memory) {
  if (limit == 0 || plan.memory <= limit) return;
  throw ResourceError("the fit would take about " +
                          MemoryText(static_cast<double>(plan.memory)) + " of " + memory +
                          ", the limit is " + MemoryText(static_cast<double>(limit)),
                      "reconstruct", "use --preset draft");
}

}  // namespace regrade
