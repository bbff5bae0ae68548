#include "pipeline/stages/styled_field.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/fields/residual_file.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/object_edit.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/blend_fields.h"

namespace regrade {

StoredField StyledFieldOf(const StoredField& source, const StoredNetwork& network,
                          double strength, const std::vector<float>* object_weights,
                          const VoxelResidual* residual) {
  const RadianceField& field = source.field;
  StoredField styled{{field.geometry, ApplyNetwork(network.network, field), network.background,
                      field.near_clip, field.march},
                     source.field_from_world,
                     source.ndc,
                     source.records};
  if (residual != nullptr) AddResidual(*residual, &styled.field.appearance);
  if (strength != 1 || object_weights != nullptr)
    styled.field = MixFields(field, {&styled.field}, {strength}, object_weights);
  RoundAsStored(&styled.field.appearance);
  return styled;
}

StoredField StyledFieldOf(const StoredField& source, const std::string& style,
                          double strength) {
  const StoredNetwork network = ReadNetworkFile(style + "/network.npz");
  std::optional<ObjectWeights> object;
  if (const std::string file = style + "/object.npz"; std::filesystem::exists(file))
    object = ReadObjectFile(file, source.records);
  std::optional<VoxelResidual> residual;
  if (const std::string file = style + "/residual.npz"; std::filesystem::exists(file))
    residual = ReadResidualFile(file, source.records);
  return StyledFieldOf(source, network, strength, object ? &object->all : nullptr,
                       residual ? &*residual : nullptr);
}

StoredField ReadStyledField(const std::string& scene, const std::string& style,
                            double strength) {
  return StyledFieldOf(ReadFieldFile(scene + "/field.npz"), style, strength);
}

StoredField ReadStyledField(const std::string& scene, const std::string& style) {
  return ReadStyledField(scene, style, StrengthOf(style));
}

void MixPicture(const Image& before, double strength, Image* after) {
  if (strength == 1) return;  // to the bit
  REGRADE_CHECK(before.SameSize(*after));
  const float of_after = static_cast<float>(strength), of_before = 1 - of_after;
  for (size_t i = 0; i < after->pixels.size(); ++i)
    after->pixels[i] = of_before * before.pixels[i] + of_after * after->pixels[i];
}

}  // namespace regrade
