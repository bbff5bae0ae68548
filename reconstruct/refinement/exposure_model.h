// The two-way model of log colours (see EQ(exposure)): its data, and its minimum by iteratively
// reweighted least squares with parts of the scene left out.
#pragma once

#include <cstddef>
#include <vector>

#include "reconstruct/refinement/exposure.h"

namespace regrade {

// Colours of a point differ by a few percent between photos because of the texture around it
// and the lens. A much larger difference is another surface or a highlight.
inline constexpr double kExposureLossScale = 0.05;

using LogColors = std::vector<Vec3d>;

struct Observation {
  size_t view, point;
  Vec3d log_light;
  double radius2 = 0;
};

struct ExposureData {
  std::vector<Observation> observations;  // used ones, grouped by point
  std::vector<size_t> tracks;             // point p has [tracks[p], tracks[p + 1])
  std::vector<int> fold_of_point;
  std::vector<std::vector<size_t>> members;  // photos connected by tracks, per group
  std::vector<bool> known;                   // photos with observations
};

// Keeps points seen by at least two photos, and photos with at least kFewestColors points;
// repeats until neither rule removes any.
ExposureData ArrangeObservations(size_t num_views,
                                 const std::vector<ColorObservation>& observations);

constexpr int kNoFold = -1;

// rho' of EQ(exposure) at a residual.
double ExposureWeight(const Vec3d& residual);

// The error of a statistic from its values without each fold in turn; see EQ(exposure-pays).
double JackknifeError(const std::vector<double>& without);

// The minimum over all points except those of a fold, starting at `start`. Photos with fewer
// than kFewestColors remaining observations get log gain 0. Each group's mean is that of
// `start`.
LogColors ReweightedGains(const ExposureData& data, int without_fold, const LogColors& start);

// The least sum of rho over the points' colours at these gains, for each fold.
std::vector<double> Disagreement(const ExposureData& data, const LogColors& gains);

// The log colour of a point with the least sum of rho at given gains.
Vec3d RobustColor(const ExposureData& data, size_t point, const LogColors& gains);

}  // namespace regrade
