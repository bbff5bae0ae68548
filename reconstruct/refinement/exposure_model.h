// The two-way model of log colours (see EQ(exposure)): its data, and its minimum by reweighted
// least squares with parts of the scene left out.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "reconstruct/refinement/exposure.h"

namespace regrade {

// Colours of one point differ by a few percent between photos for the texture beside it and the
// lens; what differs by much more than this is another surface, or a highlight.
inline constexpr double kExposureLossScale = 0.05;

using LogColors = std::vector<Vec3d>;

struct Observation {
  size_t view, point;
  Vec3d log_light;
};

struct ExposureData {
  std::vector<Observation> observations;     // useful ones, those of a point side by side
  std::vector<size_t> tracks;                // point p has [tracks[p], tracks[p + 1])
  std::vector<int> fold_of_point;            //
  std::vector<std::vector<size_t>> members;  // photos that tracks tie together, per group
  std::vector<bool> known;                   // photos with observations
};

// Keeps points that two photos see at least, in photos that have kFewestColors of them; each
// rule may undo the other, so until nothing changes.
ExposureData ArrangeObservations(size_t num_views,
                                 const std::vector<ColorObservation>& observations);

constexpr int kNoFold = -1;

// The minimum over all points but those of a fold, from `start` on; photos that have fewer than
// kFewestColors observations then have gain 0. Each group's mean is that of `start`.
LogColors ReweightedGains(const ExposureData& data, int without_fold, const LogColors& start);

// The least sum of rho that the points' colours reach at these gains, fold by fold.
std::vector<double> Disagreement(const ExposureData& data, const LogColors& gains);

// Of a point at given gains: the colour with the least sum of rho.
Vec3d RobustColor(const ExposureData& data, size_t point, const LogColors& gains);

}  // namespace regrade
