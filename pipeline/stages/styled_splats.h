// styled.ply: a style of a scene whose splats were given, for other programs.
#pragma once

#include <future>

#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

inline constexpr char kStyledSplats[] = "styled.ply";

// Begins to write it to the style's folder, in a thread of its own, if the run was given a file
// of splats: of a PLY of Gaussians, as long as it is unchanged, a copy with other colours where
// the style changes them; of other formats, and where the file is gone, a PLY in its
// coordinates. A comment in it names the program, the style and the bound of its network.
// Without such a file the future is not valid. get() throws Error(kInput), Error(kResources);
// `context` must live until then.
std::future<void> WriteStyledSplats(const RunContext& context, StoredField styled);

}  // namespace regrade
