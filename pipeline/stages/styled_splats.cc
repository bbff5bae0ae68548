#include "pipeline/stages/styled_splats.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/fields/restyled_ply.h"
#include "pipeline/fields/splat_ply.h"

namespace regrade {
namespace {

std::string CommentOf(const RunContext& context) {
  const StyleSource& style = context.settings.style;
  const StoredNetwork network = ReadNetworkFile(context.style->Path("network.npz"));
  std::string comment =
      "restyled by regrade " REGRADE_VERSION ": style " + style.name +
      Format(", Lipschitz bound of the colours %.3f", network.network.Bound());
  if (style.strength != 1) comment += Format(", strength %.3g", style.strength);
  return comment;
}

// Of the file that the run was given; empty without one.
std::string HashOfSplats(const RunContext& context) {
  const auto record = context.workspace->Find("reconstruct");
  const JsonValue* const hash = record ? record->inputs.Find("splats") : nullptr;
  return hash == nullptr ? "" : hash->AsString();
}

// Whether the given file is still there, unchanged, and in a format that is written back.
bool CanCopy(const RunContext& context) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(context.source, none)) return false;
  return IsGaussianPly(context.source) && HashFile(context.source) == HashOfSplats(context);
}

// Whether the style leaves splat i as it is: outside of its objects all are.
bool IsUntouched(const Appearance& plain, const Appearance& styled, int64_t i) {
  for (int c = 0; c < 3; ++c) {
    const float* const before = plain.sh.data() + (3 * i + c) * plain.basis;
    const float* const after = styled.sh.data() + (3 * i + c) * styled.basis;
    if (!std::equal(before, before + plain.basis, after) ||
        !std::all_of(after + plain.basis, after + styled.basis, [](float v) { return v == 0; }))
      return false;
  }
  return true;
}

NewColors ColorsOf(const StoredField& plain, const StoredField& styled) {
  const SplatTurn back(styled.field_from_world.rotation.Transposed());
  const Appearance& colors = styled.field.appearance;
  return {styled.field.geometry->num_voxels(), colors.basis,
          [&plain, &colors, back](int64_t i, float* sh) {
            if (IsUntouched(plain.field.appearance, colors, i)) return false;
            ColoredSplat record;
            std::copy_n(colors.sh.data() + i * colors.stride(), colors.stride(), record.sh);
            back.Apply(colors.basis, &record);
            std::copy_n(record.sh, colors.stride(), sh);
            return true;
          }};
}

}  // namespace

bool HasGivenSplats(const RunContext& context) { return !HashOfSplats(context).empty(); }

void WriteStyledSplats(const RunContext& context, const StoredField& plain,
                       const StoredField& styled) {
  const std::string path = context.style->Path(kStyledSplats);
  if (CanCopy(context))
    WriteRestyled(context.source, path, ColorsOf(plain, styled), CommentOf(context));
  else
    WriteSplatPly(path, styled, CommentOf(context));
}

}  // namespace regrade
