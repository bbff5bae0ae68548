#include "pipeline/fields/read_splats.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string>
#include <string_view>

#include "kernels/base/error.h"
#include "pipeline/fields/compressed_ply.h"
#include "pipeline/fields/dot_splat.h"
#include "pipeline/fields/gaussian_ply.h"
#include "pipeline/fields/ply_header.h"
#include "pipeline/fields/spz.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {
namespace {

struct OtherFormat {
  std::string_view begins;
  const char* what;
};
constexpr OtherFormat kOthers[] = {
    {"PK\x03\x04", "a zip archive: splats in SOG, or an .npz"},
    {"{", "JSON: perhaps the meta.json of splats in SOG"},
    {{"\0\1", 2}, "perhaps splats in .ksplat"},
    {"glTF", "glTF"},
};

}  // namespace

bool IsSplatFile(const std::filesystem::path& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return false;
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const char* known : {".ply", ".spz", ".splat", ".ksplat", ".sog"})
    if (ending == known) return true;
  std::ifstream file(path, std::ios::binary);
  std::string begin(64, 0);
  file.read(begin.data(), std::ssize(begin));
  begin.resize(static_cast<size_t>(file.gcount()));
  return LooksLikePly(begin) || LooksLikeSpz(begin);
}

SplatScene ReadSplats(const std::filesystem::path& path, uint64_t budget) {
  const std::string where = path.string(), bytes = ReadWholeFile(where, budget);
  if (bytes.empty()) throw InputError("the file is empty", where, "copy or download it again");
  if (LooksLikePly(bytes)) {
    const PlyHeader header = ParsePlyHeader(bytes, where);
    return IsCompressedPly(header) ? ReadCompressedPly(bytes, header, budget, where)
                                   : ReadGaussianPly(bytes, header, budget, where);
  }
  if (LooksLikeSpz(bytes)) return ReadSpz(bytes, budget, where);
  for (const OtherFormat& other : kOthers)
    if (bytes.starts_with(other.begins))
      throw InputError(std::string("not a format of splats that is read: ") + other.what, where,
                       "convert splats to PLY: `splat-transform IN OUT.ply` "
                       "(npm install -g @playcanvas/splat-transform)");
  if (LooksLikeDotSplat(bytes)) return ReadDotSplat(bytes, budget, where);
  throw InputError("not a file of splats: PLY, SPZ and .splat are read", where,
                   "convert other formats to PLY: `splat-transform IN OUT.ply`");
}

}  // namespace regrade
