#include "pipeline/stages/styled_field.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"
#include "pipeline/fields/residual_file.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/object_edit.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/blend_fields.h"
#include "stylize/training/restyle_field.h"

namespace regrade {

StoredField StyledFieldOf(StoredField source, const StoredNetwork& network, double strength,
                          const std::vector<float>* object_weights,
                          const VoxelResidual* residual) {
  source.field.appearance = PadShBasis(std::move(source.field.appearance), kStyledBasis);
  RadianceField styled = source.field;
  styled.background = network.background;
  styled.appearance = ApplyNetwork(network.network, source.field);
  if (residual != nullptr) AddResidual(*residual, &styled.appearance);
  source.field = strength == 1 && object_weights == nullptr
                     ? std::move(styled)
                     : MixFields(source.field, {&styled}, {strength}, object_weights);
  RoundAsStored(&source.field.appearance);
  return source;
}

StoredField ReadStyledField(const std::string& scene, const std::string& style,
                            double strength) {
  StoredField source = ReadFieldFile(scene + "/field.npz");
  const StoredNetwork network = ReadNetworkFile(style + "/network.npz");
  std::optional<ObjectWeights> object;
  if (const std::string file = style + "/object.npz"; std::filesystem::exists(file))
    object = ReadObjectFile(file, source.field.geometry->num_voxels());
  std::optional<VoxelResidual> residual;
  if (const std::string file = style + "/residual.npz"; std::filesystem::exists(file))
    residual = ReadResidualFile(file, source.field.geometry->num_voxels());
  return StyledFieldOf(std::move(source), network, strength, object ? &object->all : nullptr,
                       residual ? &*residual : nullptr);
}

StoredField ReadStyledField(const std::string& scene, const std::string& style) {
  const RunFile run = ReadRunFile(style + "/run.json");
  const JsonValue* strength = run.options.Find("strength");
  return ReadStyledField(scene, style, strength != nullptr ? strength->AsDouble() : 1);
}

void MixPicture(const Image& before, double strength, Image* after) {
  if (strength == 1) return;  // to the bit
  REGRADE_CHECK(before.SameSize(*after));
  const float of_after = static_cast<float>(strength), of_before = 1 - of_after;
  for (size_t i = 0; i < after->pixels.size(); ++i)
    after->pixels[i] = of_before * before.pixels[i] + of_after * after->pixels[i];
}

}  // namespace regrade
