// Is a path still the folder that it was?
#pragma once

#include <string>

#include "kernels/base/file_descriptor.h"

namespace regrade {

// Remembers a folder and keeps it open, so that no later one gets its number.
class FolderIdentity {
 public:
  // Throws as ThrowReadError.
  explicit FolderIdentity(const std::string& path);

  // False once the folder was moved or removed, or its path leads to another one; true where
  // that cannot be found out.
  bool Holds() const;

 private:
  std::string path_;
  FileDescriptor fd_;
};

}  // namespace regrade
