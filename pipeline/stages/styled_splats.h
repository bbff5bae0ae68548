// styled.ply: a style of a scene whose splats were given, for other programs.
#pragma once

#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

inline constexpr char kStyledSplats[] = "styled.ply";

// Writes it to the style's folder: of a PLY of Gaussians, as long as it is unchanged, a copy
// with other colours where the style changes them; of other formats, and where the file is
// gone, a PLY in its coordinates. A comment in it names the program, the style and the bound of
// its network. `plain`: the field before the style. Throws Error(kInput), Error(kResources).
void WriteStyledSplats(const RunContext& context, const StoredField& plain,
                       const StoredField& styled);

// Whether the run was given a file of splats.
bool HasGivenSplats(const RunContext& context);

}  // namespace regrade
