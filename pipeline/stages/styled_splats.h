// styled.ply: a style of a scene whose splats were given, for other programs.
#pragma once

#include <string>

#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

inline constexpr char kStyledSplats[] = "styled.ply";

// Writes it to the style's folder if the run was given a file of splats: of a PLY of Gaussians,
// as long as it is unchanged, a copy with other colours where the style changes them; of other
// formats, and where the file is gone, a PLY in its coordinates. A comment in it names the
// program, the style and the bound of its network. Returns whether it did. Throws
// Error(kInput), Error(kResources).
bool WriteStyledSplats(const RunContext& context, const StoredField& styled);

}  // namespace regrade
