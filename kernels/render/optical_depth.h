// Optical depth of the straight segments of a path, which no picture shows.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"

namespace regrade {

// [path.size() - 1], of a path of at least one point in world units.
std::vector<double> OpticalDepths(const RadianceField& field, const std::vector<Vec3d>& path);

// Density is sampled at half voxels along the path.
std::vector<double> VoxelDepthAlong(const RadianceField& field, const std::vector<Vec3d>& path);

// EQ(splat-clearance): a splat adds
//   -ln(1 - o exp(-q / 2)) (Phi(b) - Phi(a))
// to the optical depth of a segment, q the least squared Mahalanobis distance from its mean to
// the segment's line, a and b the ends' distances from there along the line, likewise, and Phi
// the normal distribution: as much as it hides when it is looked at along the line.
std::vector<double> SplatDepthAlong(const RadianceField& field, const std::vector<Vec3d>& path);

}  // namespace regrade
