// A PLY of Gaussians with other colours, in its own layout.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace regrade {

// Whether a file is one that WriteRestyled copies. Throws Error(kInput) as ReadSplats.
bool IsGaussianPly(const std::filesystem::path& path);

// Of the splats of ReadSplats, in their order and frame.
struct NewColors {
  int64_t count = 0;
  int basis = 1;
  // Colours [3, basis] of splat i, all coefficients of red first; false where it keeps its own.
  std::function<bool(int64_t i, float* sh)> of;
};

// Copies `path_in`, a PLY of Gaussians that ReadSplats has read, to `path_out` (atomically, it
// may be the same) with other numbers in f_dc_* and f_rest_*, and one more comment, a line of
// the header. All other bytes and the order of the vertices stay.
//
// Coefficients of degrees that the file does not have are left out; where it has more, they
// become 0. The splats that ReadSplats dropped keep their bytes.
//
// Throws Error(kUsage) for another format or colours of an integer type, Error(kInput) as
// ReadSplats and if the file no longer has as many splats, Error(kResources) as AtomicFile.
void WriteRestyled(const std::filesystem::path& path_in, const std::filesystem::path& path_out,
                   const NewColors& colors, const std::string& comment);

}  // namespace regrade
