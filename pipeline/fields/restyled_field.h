// Remakes styled.npz from field.npz and network.npz.
#pragma once

#include <vector>

#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"

namespace regrade {

// The field that stage stylize made from `source` with this network on the CPU: its file is
// byte-identical to styled.npz of that run. `object_weights` [voxels]: the sum over the regions
// of object.npz, for a run with masks; null without.
StoredField RestyledField(StoredField source, const StoredNetwork& network,
                          const std::vector<float>* object_weights = nullptr);

}  // namespace regrade
