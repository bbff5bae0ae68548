#include "pipeline/files/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {
namespace {

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }
  int Close() {
    const int fd = fd_;
    fd_ = -1;
    return ::close(fd);
  }

 private:
  int fd_;
};

[[noreturn]] void ThrowWriteError(const std::string& path, const char* step, uint64_t bytes) {
  const int error = errno;
  throw Error(ExitCode::kResources,
              std::string("cannot ") + step + " (" + std::to_string(bytes) +
                  " bytes): " + std::strerror(error),
              path,
              error == ENOSPC || error == EDQUOT || error == EFBIG
                  ? "free some space or raise the limit, then run the same command again"
                  : "check the folder's permissions, then run the same command again");
}

void SyncFolder(const std::string& folder) {
  FileDescriptor fd(
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0) return;  // a folder that cannot be opened for reading still renames
  if (::fsync(fd.get()) != 0 && errno != EINVAL && errno != EROFS)
    ThrowWriteError(folder, "sync the folder", 0);
}

}  // namespace

void WriteFileAtomically(const std::string& path, std::string_view bytes) {
  WriteFileAtomically(path, {}, bytes);
}

void WriteFileAtomically(const std::string& path, std::string_view head,
                         std::string_view bytes) {
  const size_t size = head.size() + bytes.size();
  const std::string temporary = path + kTemporarySuffix;
  try {
    FileDescriptor fd(
        ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644));
    if (fd.get() < 0) ThrowWriteError(path, "create", size);
    for (const std::string_view part : {head, bytes})
      for (size_t done = 0; done < part.size();) {
        const ssize_t n = ::write(fd.get(), part.data() + done, part.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) ThrowWriteError(path, "write", size);
        done += static_cast<size_t>(n);
      }
    if (::fsync(fd.get()) != 0) ThrowWriteError(path, "flush to disk", size);
    if (fd.Close() != 0) ThrowWriteError(path, "close", size);
    if (::rename(temporary.c_str(), path.c_str()) != 0)
      ThrowWriteError(path, "rename into place", size);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
  SyncFolder(std::filesystem::path(path).parent_path().string());
}

void RenameDurably(const std::string& from, const std::string& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) ThrowWriteError(to, "rename into place", 0);
  SyncFolder(std::filesystem::path(to).parent_path().string());
}

void ThrowReadError(const std::string& path) {
  const int error = errno;
  if (error == EIO || error == ESTALE || error == ENODEV)
    throw Error(ExitCode::kResources, std::string("cannot read: ") + std::strerror(error), path,
                "is its drive still there? then run the same command again");
  if (error == EMFILE || error == ENFILE || error == ENOMEM)
    throw Error(ExitCode::kResources, std::string("cannot read: ") + std::strerror(error), path,
                "raise the limit (ulimit -n, ulimit -v), then run the same command again");
  throw Error(ExitCode::kInput, std::strerror(error), path);
}

std::string ReadWholeFile(const std::string& path, uint64_t max_bytes) {
  FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (fd.get() < 0) ThrowReadError(path);
  struct stat status;
  if (::fstat(fd.get(), &status) != 0) ThrowReadError(path);
  if (!S_ISREG(status.st_mode)) throw Error(ExitCode::kInput, "not a regular file", path);
  if (static_cast<uint64_t>(status.st_size) > max_bytes)
    throw Error(ExitCode::kInput,
                std::to_string(status.st_size) + " bytes, more than the limit of " +
                    std::to_string(max_bytes),
                path);
  std::string bytes(static_cast<size_t>(status.st_size), '\0');
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(fd.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowReadError(path);
    if (n == 0)
      throw Error(ExitCode::kInput, "the file became shorter while it was read", path);
    done += static_cast<size_t>(n);
  }
  return bytes;
}

}  // namespace regrade
