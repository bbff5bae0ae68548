// The field of a style, made from the scene's field and what is stored of the style.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "stylize/field/voxel_residual.h"

namespace regrade {

// `source` restyled by the network, on the CPU, and mixed with itself by 1 - `strength`, see
// EQ(style-mix); colours as a file stores them. `object_weights` [voxels]: the sum over the
// regions of object.npz; null where the whole scene is styled. `residual`: what is
// added behind the network, see EQ(view-scale), or null. Deterministic: equal inputs give
// equal bits, for any number of threads.
StoredField StyledFieldOf(const StoredField& source, const StoredNetwork& network,
                          double strength, const std::vector<float>* object_weights,
                          const VoxelResidual* residual = nullptr);

// The same with the network.npz, object.npz and residual.npz of the style's folder. Throws
// Error(kInput).
StoredField StyledFieldOf(const StoredField& source, const std::string& style, double strength);

// The same of field.npz in the output folder `scene`.
StoredField ReadStyledField(const std::string& scene, const std::string& style,
                            double strength);

// With the strength in the style's run.json.
StoredField ReadStyledField(const std::string& scene, const std::string& style);

// The same of pictures: what a 2D method made of `before` at full strength, mixed with it.
void MixPicture(const Image& before, double strength, Image* after);

}  // namespace regrade
