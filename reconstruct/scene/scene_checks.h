// Checks whether a posed capture can be reconstructed, by measures of its geometry.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

// Of each point the largest angle, in radians, between two rays that see it: small angles mean
// inaccurate depth.
std::vector<double> TriangulationAngles(const Capture& capture);
// Their median; 0 without points.
double MedianTriangulationAngle(const Capture& capture);

// The capture without the points that are seen under less than `least_deg`: their distance is
// unknown, so they may lie thousands of times too far. Unchanged if that leaves fewer than 50
// points or a tenth of them, as of distant scenes.
Capture WithParallax(const Capture& capture, double least_deg);
// COLMAP's own limit, Mapper.filter_min_tri_angle, which points that it adds last escape.
inline constexpr double kLeastParallaxDeg = 1.5;

// Root-mean-square extents of the points along their principal axes, largest first, in world
// units, without the tenth of the points farthest from the median (outliers and sky).
// Zero with fewer than ten points.
Vec3d PointExtents(const Capture& capture);

// The view whose ratio fx / fy is farthest from 1 (as |log|); its ratio. 1 without views.
// Detects failed self-calibration, since sensors have square pixels.
double WorstPixelAspect(const Capture& capture);

// Largest distance between two of these points; 0 for fewer.
double LargestDistance(const std::vector<Vec3d>& points);

// What is implausible about the views' lenses, worded to follow "the estimated camera has";
// empty if there is nothing. Photos that do not determine a lens give pixels that are not
// square, a focal length far from any lens's, or a distortion that maps two rays to one image
// point.
std::string ImplausibleLens(const Capture& capture, double max_pixel_aspect);

struct SceneLimits {
  int min_views = 5;
  double min_triangulation_angle_deg = kLeastParallaxDeg;
  double max_pixel_aspect = 1.05;  // fx / fy within [1 / this, this]
  double min_thickness = 0.02;     // third extent over second; below: nearly a plane
};

// Messages for a photographer: the problem, the number, and the remedy.
struct SceneAssessment {
  std::string refusal;             // empty: the scene is usable
  std::string remedy;              // of the refusal
  std::string lens;                // ImplausibleLens, if that is why; else empty
  std::vector<std::string> notes;  // warnings about a usable scene
};

SceneAssessment AssessScene(const Capture& capture, const SceneLimits& limits = {});

}  // namespace regrade
