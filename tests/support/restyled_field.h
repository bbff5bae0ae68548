// Remakes styled.npz from field.npz and network.npz.
#pragma once

#include <utility>
#include <vector>

#include "kernels/field/pad_sh_basis.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/blend_fields.h"

namespace regrade::testing {

// The field that stage stylize made from `source` with this network on the CPU: its file is
// byte-identical to styled.npz of that run. `object_weights` [voxels]: the sum over the regions
// of object.npz, for a run with masks; null without.
inline StoredField RestyledField(StoredField source, const StoredNetwork& network,
                                 const std::vector<float>* object_weights = nullptr) {
  constexpr int kStyledBasis = 9;
  source.field.appearance = PadShBasis(std::move(source.field.appearance), kStyledBasis);
  RadianceField styled = source.field;
  styled.background = network.background;
  styled.appearance = ApplyNetwork(network.network, source.field);
  source.field = object_weights == nullptr
                     ? std::move(styled)
                     : MixFields(source.field, {&styled}, {1}, object_weights);
  return source;
}

}  // namespace regrade::testing
