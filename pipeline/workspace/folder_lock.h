// Locks an output folder for one run; the kernel releases the lock when the process ends.
#pragma once

#include <string>

#include "kernels/base/file_descriptor.h"

namespace regrade {

// Beside `path`, of this process alone: others may write the same file at the same time.
std::string OwnTemporary(const std::string& path);

enum class LockUse {
  kAlone,   // nobody else holds it
  kShared,  // others may share it, and nobody holds it alone
};

// Holds flock on `path`, a file that is created and stays; its text names pid, host and start
// time of the holder; who shares it adds a line.
class FolderLock {
 public:
  // Throws Error(kFolderInUse) naming the holder, Error(kResources) if the file cannot be
  // written.
  FolderLock(const std::string& path, LockUse use);

 private:
  FileDescriptor fd_;
};

}  // namespace regrade
