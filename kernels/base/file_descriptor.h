// Owner of a file descriptor.
#pragma once

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

}  // namespace regrade
