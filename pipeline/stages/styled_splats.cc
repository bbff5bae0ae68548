#include "pipeline/stages/styled_splats.h"

#include <algorithm>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/fields/placed_splats.h"
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

// Whether the given file is still there, unchanged, and in a format that is written back.
bool CanCopy(const RunContext& context, const std::string& hash) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(context.source, none)) return false;
  return IsGaussianPly(context.source) && HashFile(context.source) == hash;
}

// The splats that the style leaves as they are: outside of its objects all are.
std::vector<bool> Untouched(const RunContext& context, const Appearance& styled) {
  const Appearance plain = ReadFieldFile(context.workspace->Path("field.npz")).field.appearance;
  const int64_t stride = plain.stride();
  std::vector<bool> untouched;
  for (int64_t i = 0; i < plain.sh.size(); i += stride)
    untouched.push_back(
        std::equal(plain.sh.data() + i, plain.sh.data() + i + stride, styled.sh.data() + i));
  return untouched;
}

}  // namespace

std::future<void> WriteStyledSplats(const RunContext& context, StoredField styled) {
  const std::string path = context.style->Path(kStyledSplats);
  const auto record = context.workspace->Find("reconstruct");
  const JsonValue* const hash = record ? record->inputs.Find("splats") : nullptr;
  if (hash == nullptr) {
    std::filesystem::remove(path);
    return {};
  }
  return std::async(std::launch::async, [&context, path, hash = hash->AsString(),
                                         styled = std::move(styled)] {
    const Appearance& colors = styled.field.appearance;
    if (CanCopy(context, hash))
      WriteRestyled(context.source, path,
                    ColorsBeforeMove(styled.field_from_world,
                                     {colors.sh.data(), static_cast<size_t>(colors.sh.size())},
                                     colors.basis),
                    colors.basis, CommentOf(context), Untouched(context, colors));
    else
      WriteSplatPly(path, styled, CommentOf(context));
  });
}

}  // namespace regrade
