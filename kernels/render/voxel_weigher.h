// The weights with which rays see voxels: by marching.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/render/ray_weigher.h"

namespace regrade {

// See MakeRayWeigher and RayDepths; nothing is kept, and depths need no weigher.
std::unique_ptr<RayWeigher> MakeVoxelWeigher(const Geometry& geometry, float near_clip,
                                             const MarchOptions& march, int64_t kept_bytes);
std::vector<double> VoxelDepths(const RadianceField& field, const ViewRays& rays,
                                RayWeigher* weigher);

}  // namespace regrade
