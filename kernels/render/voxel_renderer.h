// Renders a field of voxels, and weighs their samples along rays: by marching.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/render/render_kind.h"

namespace regrade {

std::unique_ptr<Renderer> MakeVoxelRenderer(const RadianceField& field, Backend backend);
std::unique_ptr<Renderer> TakeVoxels(RadianceField&& field, Backend backend);

// See MakeRayWeigher and RayDepths; nothing is kept, and depths need no weigher.
std::unique_ptr<RayWeigher> MakeVoxelWeigher(const Geometry& geometry, float near_clip,
                                             const MarchOptions& march, int64_t kept_bytes);
std::vector<double> VoxelDepths(const RadianceField& field, const ViewRays& rays,
                                RayWeigher* weigher);

}  // namespace regrade
