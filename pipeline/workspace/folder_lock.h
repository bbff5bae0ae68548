// Locks an output folder for one run; the kernel releases the lock when the process ends.
#pragma once

#include <string>

#include "kernels/base/file_descriptor.h"

namespace regrade {

// Holds flock on `path`, a file that is created and stays; its text names pid, host and start
// time of the holder.
class FolderLock {
 public:
  // Throws Error(kFolderInUse) naming the holder, Error(kResources) if the file cannot be
  // written. `break_lock` replaces the file of a lock that was not released (by a network
  // drive); it is refused while the holder is alive on this machine.
  FolderLock(const std::string& path, bool break_lock);

 private:
  FileDescriptor fd_;
};

}  // namespace regrade
