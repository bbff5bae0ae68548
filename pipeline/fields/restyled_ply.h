// A PLY of Gaussians with other colours, in its own layout.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace regrade {

// Whether a file is one that WriteRestyled copies. Throws Error(kInput) as ReadSplats.
bool IsGaussianPly(const std::filesystem::path& path);

// Copies `path_in`, a PLY of Gaussians that ReadSplats has read, to `path_out` (atomically, it
// may be the same) with other numbers in f_dc_* and f_rest_*, and one more comment, a line of
// the header. All other bytes and the order of the vertices stay.
//
// `sh` [N, 3, basis]: of the N splats of ReadSplats, in their order and frame, all coefficients
// of red first. Coefficients of degrees that the file does not have are left out; where it has
// more, they become 0. The splats that ReadSplats dropped keep their bytes, and so do those of
// `kept` [N], which may be empty: none.
//
// Throws Error(kUsage) for another format or colours of an integer type, Error(kInput) as
// ReadSplats and if the file no longer has N such splats, Error(kResources) as AtomicFile.
void WriteRestyled(const std::filesystem::path& path_in, const std::filesystem::path& path_out,
                   std::span<const float> sh, int basis, const std::string& comment,
                   const std::vector<bool>& kept = {});

}  // namespace regrade
