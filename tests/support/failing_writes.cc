// A library to preload: the k-th write operation below a folder fails, once or from then on.
//
//   FAILING_WRITES_UNDER   the folder, absolute
//   FAILING_WRITES_AT      k, from 1; 0 or unset: none fails, operations are only counted
//   FAILING_WRITES_KIND    ENOSPC, EIO, or SHORT (writes half of its bytes, without an error)
//   FAILING_WRITES_ALWAYS  if set, every later operation fails too, as on a full disk
//   FAILING_WRITES_COUNT   file for the number of operations, written when the program ends
//
// Operations are: opening for writing, write, pwrite, writev, fsync, fdatasync, rename, mkdir.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

constexpr int kMaxFiles = 1 << 16;
std::atomic<bool> watched[kMaxFiles];
std::atomic<long> operations{0};

template <typename Function>
Function Real(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

bool Below(const char* path) {
  const char* folder = getenv("FAILING_WRITES_UNDER");
  if (folder == nullptr || path == nullptr) return false;
  char whole[PATH_MAX];
  if (path[0] != '/') {
    char here[PATH_MAX];
    if (getcwd(here, sizeof here) == nullptr) return false;
    if (snprintf(whole, sizeof whole, "%s/%s", here, path) >= static_cast<int>(sizeof whole))
      return false;
    path = whole;
  }
  return strncmp(path, folder, strlen(folder)) == 0;
}

bool IsShort() {
  const char* kind = getenv("FAILING_WRITES_KIND");
  return kind != nullptr && strcmp(kind, "SHORT") == 0;
}

// Counts an operation; true, with errno set, if it must fail.
bool Fails() {
  const long number = ++operations;
  const char* at = getenv("FAILING_WRITES_AT");
  const long k = at == nullptr ? 0 : atol(at);
  if (k <= 0 || number < k || (number > k && getenv("FAILING_WRITES_ALWAYS") == nullptr))
    return false;
  const char* kind = getenv("FAILING_WRITES_KIND");
  errno = kind != nullptr && strcmp(kind, "EIO") == 0 ? EIO : ENOSPC;
  return true;
}

bool FailsUnlessShort() { return Fails() && !IsShort(); }

bool Watched(int fd) { return fd >= 0 && fd < kMaxFiles && watched[fd]; }

void Watch(int fd, bool on) {
  if (fd >= 0 && fd < kMaxFiles) watched[fd] = on;
}

bool ForWriting(int flags) { return (flags & O_ACCMODE) != O_RDONLY; }

__attribute__((destructor)) void WriteCount() {
  const char* path = getenv("FAILING_WRITES_COUNT");
  if (path == nullptr) return;
  const int fd =
      Real<int (*)(const char*, int, ...)>("open")(path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (fd < 0) return;
  char text[32];
  const int size = snprintf(text, sizeof text, "%ld\n", operations.load());
  if (Real<ssize_t (*)(int, const void*, size_t)>("write")(fd, text,
                                                           static_cast<size_t>(size)) < 0)
    abort();
  Real<int (*)(int)>("close")(fd);
}

template <typename Call>
int Opened(const char* path, int flags, const Call& call) {
  const bool counts = ForWriting(flags) && Below(path);
  if (counts && FailsUnlessShort()) return -1;
  const int fd = call();
  Watch(fd, counts && fd >= 0);
  return fd;
}

mode_t ModeOf(int flags, va_list list) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
}

}  // namespace

extern "C" {

#define OPEN_LIKE(name)                                                      \
  int name(const char* path, int flags, ...) {                               \
    va_list list;                                                            \
    va_start(list, flags);                                                   \
    const mode_t mode = ModeOf(flags, list);                                 \
    va_end(list);                                                            \
    return Opened(path, flags, [&] {                                         \
      return Real<int (*)(const char*, int, ...)>(#name)(path, flags, mode); \
    });                                                                      \
  }
OPEN_LIKE(open)
OPEN_LIKE(open64)

#define OPENAT_LIKE(name)                                                             \
  int name(int at, const char* path, int flags, ...) {                                \
    va_list list;                                                                     \
    va_start(list, flags);                                                            \
    const mode_t mode = ModeOf(flags, list);                                          \
    va_end(list);                                                                     \
    return Opened(path, flags, [&] {                                                  \
      return Real<int (*)(int, const char*, int, ...)>(#name)(at, path, flags, mode); \
    });                                                                               \
  }
OPENAT_LIKE(openat)
OPENAT_LIKE(openat64)

int close(int fd) {
  Watch(fd, false);
  return Real<int (*)(int)>("close")(fd);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  const auto real = Real<ssize_t (*)(int, const void*, size_t)>("write");
  if (Watched(fd) && Fails()) {
    if (!IsShort()) return -1;
    return real(fd, bytes, size > 1 ? size / 2 : size);
  }
  return real(fd, bytes, size);
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  if (Watched(fd) && FailsUnlessShort()) return -1;
  return Real<ssize_t (*)(int, const struct iovec*, int)>("writev")(fd, parts, count);
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) {
  if (Watched(fd) && FailsUnlessShort()) return -1;
  return Real<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64")(fd, bytes, size,
                                                                          offset);
}

int fsync(int fd) {
  if (Watched(fd) && FailsUnlessShort()) return -1;
  return Real<int (*)(int)>("fsync")(fd);
}

int fdatasync(int fd) {
  if (Watched(fd) && FailsUnlessShort()) return -1;
  return Real<int (*)(int)>("fdatasync")(fd);
}

int rename(const char* from, const char* to) {
  if (Below(to) && FailsUnlessShort()) return -1;
  return Real<int (*)(const char*, const char*)>("rename")(from, to);
}

int mkdir(const char* path, mode_t mode) {
  if (Below(path) && FailsUnlessShort()) return -1;
  return Real<int (*)(const char*, mode_t)>("mkdir")(path, mode);
}

}  // extern "C"
