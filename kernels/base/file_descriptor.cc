#include "kernels/base/file_descriptor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace regrade {

int FileDescriptor::Close() {
  const int fd = Release();
  return fd < 0 ? 0 : ::close(fd);
}

int OpenOwnFile(const std::string& path, int flags, unsigned mode) {
  FileDescriptor fd(
      ::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY, mode));
  struct stat status;
  if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0) return -1;
  if (S_ISREG(status.st_mode)) return fd.Release();
  errno = S_ISDIR(status.st_mode) ? EISDIR : ENXIO;
  return -1;
}

}  // namespace regrade
