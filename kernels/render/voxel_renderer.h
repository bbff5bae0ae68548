// Renders a field of voxels.
#pragma once

#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/kind_renderer.h"

namespace regrade {

// Of the fast renderers of voxels: the transmittance at which a ray ends; on a GPU the step of
// opacity at which a colour is evaluated, see EQ(opacity-steps); on the CPU the tolerance of
// EQ(smooth-pixels). Errors and times are in COSTS.md.
inline constexpr float kFastStop = 1e-3f, kFastOpacityStep = 1.0f / 128,
                       kSmoothTolerance = 1.5f / 255;
inline constexpr char kFastRendererOfGpu[] =
    "half precision, steps where opacity changes by 1/128; at least 55 dB from the exact "
    "frames";
inline constexpr char kFastRendererOfCpu[] =
    "smooth parts interpolated between rays; at least 55 dB from the exact frames";

std::unique_ptr<KindRenderer> MakeVoxelRenderer(const RadianceField& field, Backend backend);

}  // namespace regrade
