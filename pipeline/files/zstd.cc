#include "pipeline/files/zstd.h"

#ifdef REGRADE_ZSTD
#include <zstd.h>
#endif

#include "kernels/base/error.h"

namespace regrade {

bool HaveZstd() {
#ifdef REGRADE_ZSTD
  return true;
#else
  return false;
#endif
}

std::string UnpackZstd([[maybe_unused]] std::string_view packed,
                       [[maybe_unused]] uint64_t bytes, const std::string& where) {
#ifdef REGRADE_ZSTD
  std::string unpacked(bytes, '\0');
  const size_t done =
      ZSTD_decompress(unpacked.data(), unpacked.size(), packed.data(), packed.size());
  if (ZSTD_isError(done) || done != bytes)
    throw InputError("compressed data is damaged", where,
                     "the file is incomplete or damaged: copy or download it again");
  return unpacked;
#else
  throw InputError("this program was built without Zstandard, which the file needs", where,
                   "build it with libzstd-dev, or convert the file (`splat-transform`)");
#endif
}

}  // namespace regrade
