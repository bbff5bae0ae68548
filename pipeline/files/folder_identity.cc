#include "pipeline/files/folder_identity.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>

#include "pipeline/files/atomic_file.h"

namespace regrade {

FolderIdentity::FolderIdentity(const std::string& path)
    : path_(path), fd_(::open(path.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC)) {
  if (fd_.get() < 0) ThrowReadError(path);
}

bool FolderIdentity::Holds() const {
  struct stat held, there;
  if (::stat(path_.c_str(), &there) != 0) return errno != ENOENT && errno != ENOTDIR;
  return ::fstat(fd_.get(), &held) != 0 ||
         (held.st_dev == there.st_dev && held.st_ino == there.st_ino);
}

}  // namespace regrade
