// Owner of a file descriptor, and how files of our own are opened.
#pragma once

#include <string>

namespace regrade {

class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() { Close(); }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  int get() const { return fd_; }  // negative: none
  // Replaces the descriptor; the old one is closed.
  void Reset(int fd) {
    Close();
    fd_ = fd;
  }
  // The caller closes it.
  int Release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }
  // close()'s result; 0 where there is none.
  int Close();

 private:
  int fd_ = -1;
};

// open() with `flags`, O_CLOEXEC and, for a new file, `mode`, of a file that is ours: a link is
// not followed, a named pipe is not waited for, and what is no regular file is closed again.
// Negative, with errno, where there is none: ELOOP for a link, ENXIO for a pipe or device.
int OpenOwnFile(const std::string& path, int flags, unsigned mode = 0644);

}  // namespace regrade
