#include "pipeline/files/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/files/file_problem.h"

namespace regrade {
namespace {

constexpr size_t kPending = 1 << 20;  // bytes

[[noreturn]] void ThrowWriteError(const std::string& path, const char* step, uint64_t bytes) {
  const int error = errno;
  throw ResourceError(
      Concat("cannot ", step, " (", bytes, " bytes): ", FileProblem(error)), path,
      FileRemedy(error, "check the folder's permissions, then run the same command again"));
}

void SyncFolder(const std::string& folder) {
  FileDescriptor fd(
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0) return;  // a folder that cannot be opened for reading still renames
  if (::fsync(fd.get()) != 0 && errno != EINVAL && errno != EROFS)
    ThrowWriteError(folder, "sync the folder", 0);
}

}  // namespace

AtomicFile::AtomicFile(const std::string& path, uint64_t bytes)
    : path_(path), temporary_(path + kTemporarySuffix), bytes_(bytes) {
  fd_.Reset(OpenOwnFile(temporary_, O_WRONLY | O_CREAT | O_TRUNC));
  if (fd_.get() < 0)
    ThrowWriteError(errno == ELOOP || errno == ENXIO ? temporary_ : path_, "create", bytes_);
}

AtomicFile::~AtomicFile() {
  if (!committed_) ::unlink(temporary_.c_str());
}

void AtomicFile::WriteThrough(const char* data, size_t size) {
  for (size_t done = 0; done < size;) {
    const ssize_t n = ::write(fd_.get(), data + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ThrowWriteError(path_, "write", bytes_);
    done += static_cast<size_t>(n);
  }
}

void AtomicFile::Flush() {
  WriteThrough(pending_.data(), pending_.size());
  pending_.clear();
}

void AtomicFile::Write(const void* data, size_t size) {
  const char* const bytes = static_cast<const char*>(data);
  if (pending_.size() + size > kPending) Flush();
  if (size > kPending)
    WriteThrough(bytes, size);
  else
    pending_.append(bytes, size);
  position_ += size;
  size_ = std::max(size_, position_);
}

void AtomicFile::Seek(uint64_t position) {
  if (position == position_) return;
  Flush();
  if (::lseek(fd_.get(), static_cast<off_t>(position), SEEK_SET) < 0)
    ThrowWriteError(path_, "seek", bytes_);
  position_ = position;
}

void AtomicFile::Commit() {
  Flush();
  if (::fsync(fd_.get()) != 0) ThrowWriteError(path_, "flush to disk", bytes_);
  if (fd_.Close() != 0) ThrowWriteError(path_, "close", bytes_);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0)
    ThrowWriteError(path_, "rename into place", bytes_);
  committed_ = true;
  SyncFolder(std::filesystem::path(path_).parent_path().string());
}

void WriteFileAtomically(const std::string& path, std::string_view bytes) {
  WriteFileAtomically(path, std::vector<std::string_view>{bytes});
}

void WriteFileAtomically(const std::string& path, const std::vector<std::string_view>& pieces) {
  uint64_t size = 0;
  for (const std::string_view piece : pieces) size += piece.size();
  AtomicFile file(path, size);
  for (const std::string_view piece : pieces) file.Write(piece.data(), piece.size());
  file.Commit();
}

void SyncFile(const std::string& path) {
  const FileDescriptor fd(OpenOwnFile(path, O_WRONLY));
  if (fd.get() < 0) ThrowWriteError(path, "open again", 0);
  if (::fsync(fd.get()) != 0) ThrowWriteError(path, "flush to disk", 0);
}

void RenameDurably(const std::string& from, const std::string& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) ThrowWriteError(to, "rename into place", 0);
  SyncFolder(std::filesystem::path(to).parent_path().string());
}

void ThrowReadError(const std::string& path) {
  const int error = errno;
  if (error == EIO || error == ESTALE || error == ENODEV)
    throw ResourceError(std::string("cannot read: ") + std::strerror(error), path,
                        "is its drive still there? then run the same command again");
  if (error == EMFILE || error == ENFILE || error == ENOMEM)
    throw ResourceError(std::string("cannot read: ") + std::strerror(error), path,
                        FileRemedy(error, ""));
  throw InputError(std::strerror(error), path);
}

int OpenToRead(const std::string& path, uint64_t* size) {
  FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status;
  if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0) ThrowReadError(path);
  if (!S_ISREG(status.st_mode)) throw InputError("not a regular file", path);
  if (size != nullptr) *size = static_cast<uint64_t>(status.st_size);
  return fd.Release();
}

std::string ReadWholeFile(const std::string& path, uint64_t max_bytes) {
  uint64_t size = 0;
  const FileDescriptor fd(OpenToRead(path, &size));
  if (size > max_bytes)
    throw InputError(Concat(size, " bytes, more than the limit of ", max_bytes), path);
  std::string bytes(size, '\0');
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(fd.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowReadError(path);
    if (n == 0) throw InputError("the file became shorter while it was read", path);
    done += static_cast<size_t>(n);
  }
  return bytes;
}

}  // namespace regrade
