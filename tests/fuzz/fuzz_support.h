// Shared by fuzz targets: a file to read, and the check of the result.
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

// Thrown where an accepted input breaks a guarantee.
class BrokenPremise : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

inline void FuzzRequire(bool kept, const char* guarantee) {
  if (!kept) throw BrokenPremise(std::string("accepted, but not so: ") + guarantee);
}

// True if `read` returned, false if it threw an Error with a reason and an exit code of bad
// input.
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

// A file with the given bytes in a folder of this process, which is removed at its end. It is
// in memory if possible: a disk would dominate the time.
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
