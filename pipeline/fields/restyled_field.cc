#include "pipeline/fields/restyled_field.h"

#include <utility>

#include "kernels/field/pad_sh_basis.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/blend_fields.h"

namespace regrade {
namespace {

constexpr int kStyledBasis = 9;

}  // namespace

StoredField RestyledField(StoredField source, const StoredNetwork& network,
                          const std::vector<float>* object_weights) {
  source.field.appearance = PadShBasis(std::move(source.field.appearance), kStyledBasis);
  RadianceField styled = source.field;
  styled.background = network.background;
  styled.appearance = ApplyNetwork(network.network, source.field);
  source.field = object_weights == nullptr
                     ? std::move(styled)
                     : MixFields(source.field, {&styled}, {1}, object_weights);
  return source;
}

}  // namespace regrade
