// The final bundle adjustment: frees the principal point, which COLMAP's mapper keeps fixed,
// and chooses the simplest lens that explains the photos.
#pragma once

#include <functional>
#include <string>

#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"
#include "reconstruct/colmap/simpler_lens.h"

namespace regrade {

struct LensAttempt {
  ColmapLens lens = ColmapLens::kPinhole;
  bool free_center = false;  // adjust the principal point
  bool held = false;         // adjust neither focal lengths nor distortion
};

struct RefinedModel {
  std::string folder;  // where COLMAP wrote it
  ColmapModel model;
  LensAttempt attempt;
  std::string lens;  // for the report: "PINHOLE, free principal point"
  double mean_squared_px = 0;
};

// Mean squared reprojection error, pixels^2, over the observations in front of their cameras.
double MeanSquaredReprojection(const ColmapModel& model);

// The model with another lens: keeps centre, the coefficients that both lenses have, and focal
// lengths, or their geometric mean where the lens has one. `lens` is kSimplePinhole, kPinhole,
// kSimpleRadial or kOpenCv.
ColmapModel WithLens(const ColmapModel& model, ColmapLens lens);

// `model` without observations whose error in `reference` (the same images, cameras and points,
// possibly adjusted) exceeds `factor` times the median error, and without points with fewer
// than two remaining observations. COLMAP's adjustment has no robust loss and its mapper
// accepts 4 pixels: on strecha/fountain-P11 the outliers alone rotate all cameras by half a
// degree.
ColmapModel WithoutOutliers(const ColmapModel& model, const ColmapModel& reference,
                            double factor);

// Adjusts the mapper's model `mapped` without outliers, with PINHOLE and OPENCV lenses and a
// free principal point. Chooses PINHOLE unless OPENCV moves a corner of a picture by more than
// half a pixel and reduces the mean squared error by more than 3 %. Adjusts once more with the
// outliers determined by the result. If a principal point moves by more than a tenth of the
// picture or the pixels are not square, the principal point stays in the centre. With less
// than full `freedom` there is one lens instead: SIMPLE_RADIAL, or SIMPLE_PINHOLE that keeps
// its focal length, in the centre. COLMAP's results go to folders under `work_folder`. Calls
// `on_step(i, n)` before adjustment i of at most n.
RefinedModel RefineIntrinsics(ColmapProgram& colmap, const ColmapModel& mapped,
                              LensFreedom freedom, const std::string& work_folder,
                              const ColmapProgram::Limits& limits,
                              const std::function<void(int, int)>& on_step,
                              const KeepGoingFunction& keep_going);

}  // namespace regrade
