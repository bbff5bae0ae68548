// One run at a time works in an output folder: a lock that the kernel releases when its holder
// dies, however it dies.
#pragma once

#include <string>

namespace regrade {

// Holds `path` (a file that is created and stays) with flock on an open descriptor; the file's
// text names pid, host and start time for the next who asks.
class FolderLock {
 public:
  // Throws Error(kFolderInUse) naming the holder, Error(kResources) where nothing can be
  // written. `break_lock` takes a lock whose holder cannot be asked (a network drive that has
  // forgotten to release it) by putting a new file in its place; it is refused while the holder
  // is alive on this machine.
  FolderLock(const std::string& path, bool break_lock);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_ = -1;
};

}  // namespace regrade
