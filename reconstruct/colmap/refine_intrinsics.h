// The last bundle adjustment: frees what COLMAP's mapper keeps fixed (the principal point) and
// finds the simplest lens that explains the photos.
#pragma once

#include <functional>
#include <string>

#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"

namespace regrade {

struct LensAttempt {
  ColmapLens lens = ColmapLens::kPinhole;
  bool free_center = false;  // is the principal point adjusted?
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

// The same model with another lens: focal lengths and centre are kept, the coefficients that
// both lenses have as well. `lens` is kPinhole or kOpenCv.
ColmapModel WithLens(const ColmapModel& model, ColmapLens lens);

// `grown` without the observations whose error under `judge` (the same images, cameras and
// points, perhaps adjusted) exceeds `factor` times the median error, and without points that
// are seen fewer than two times then. COLMAP's adjustment has no robust loss and its mapper
// admits 4 pixels: on strecha/fountain-P11 the outliers alone turn all cameras by half a
// degree.
ColmapModel WithoutOutliers(const ColmapModel& grown, const ColmapModel& judge, double factor);

// Adjusts `grown`, outliers removed, with PINHOLE and with OPENCV lenses, principal point free,
// and keeps PINHOLE unless OPENCV moves a corner of a picture by more than half a pixel and
// lowers the mean squared error by more than 3 %; then once more with the outliers told by the
// result. Where a principal point runs off by more than a tenth of the picture or the pixels
// cease to be square, the principal point stays in the centre. COLMAP's results go to folders
// under `work_folder`. `on_step(i, n)` comes before adjustment i of n at most.
RefinedModel RefineIntrinsics(ColmapProgram& colmap, const ColmapModel& grown,
                              const std::string& work_folder,
                              const ColmapProgram::Limits& limits,
                              const std::function<void(int, int)>& on_step,
                              const KeepGoingFunction& keep_going);

}  // namespace regrade
