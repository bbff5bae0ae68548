#include "kernels/base/file_descriptor.h"

#include <unistd.h>

namespace regrade {

int FileDescriptor::Close() {
  const int fd = Release();
  return fd < 0 ? 0 : ::close(fd);
}

}  // namespace regrade
