// What the bodies of fuzz targets share: a file to read from, and what counts as an answer.
#pragma once

#include <stdlib.h>

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include "kernels/base/error.h"
#include "tests/support/temporary_folder.h"

namespace regrade::testing {

// A guarantee that an accepted input has broken.
class BrokenPremise : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

inline void FuzzRequire(bool kept, const char* guarantee) {
  if (!kept) throw BrokenPremise(std::string("accepted, but not so: ") + guarantee);
}

// True if `read` came to its end, false if it refused with an Error of one of the kinds that
// bad input can have, and said why.
template <typename Read>
bool Accepts(const Read& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    FuzzRequire(error.code() == ExitCode::kInput || error.code() == ExitCode::kUsage,
                "a refusal of bad input exits with 2 or 3");
    FuzzRequire(!error.what_failed().empty(), "a refusal says why");
    return false;
  }
}

// A file in a folder of this process, with the bytes given; the folder goes when it ends. It
// lies in memory where it can: a disk would be what is measured.
inline const std::string& FuzzFolder() {
  static const TemporaryFolder folder = [] {
    if (std::filesystem::is_directory("/dev/shm")) ::setenv("TMPDIR", "/dev/shm", 0);
    return TemporaryFolder();
  }();
  return folder.path();
}
inline std::string FuzzFile(const std::string& name, std::string_view bytes) {
  const std::string path = FuzzFolder() + "/" + name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  const bool whole =
      file != nullptr && std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  if (file == nullptr || std::fclose(file) != 0 || !whole) std::abort();
  return path;
}

}  // namespace regrade::testing
