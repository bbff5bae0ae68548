#include "pipeline/splat_files/read_splats.h"

#include <string>
#include <string_view>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/splat_files/compressed_ply.h"
#include "pipeline/splat_files/dot_splat.h"
#include "pipeline/splat_files/gaussian_ply.h"
#include "pipeline/splat_files/ply_header.h"
#include "pipeline/splat_files/spz.h"

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
