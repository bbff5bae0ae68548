#include "pipeline/workspace/folder_lock.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <sstream>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/file_problem.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

constexpr uint64_t kMaxHolderBytes = 1 << 20;

std::string HostName() {
  char name[256] = {};
  ::gethostname(name, sizeof name - 1);
  return name;
}

std::string HolderText() {
  const std::time_t now = std::time(nullptr);
  std::tm utc = {};
  gmtime_r(&now, &utc);
  char start[32];
  std::strftime(start, sizeof start, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return DumpJson(JsonValue::Object{{"pid", static_cast<int64_t>(::getpid())},
                                    {"host", HostName()},
                                    {"start", start}},
                  -1) +
         "\n";
}

struct Holder {
  int64_t pid = 0;
  std::string host, start;

  std::string Text() const {
    if (pid == 0) return "another run (it has not identified itself yet)";
    return Concat("process ", pid, " on ", host, ", started ", start);
  }
  bool AliveHere() const {
    return pid > 0 && host == HostName() &&
           (::kill(static_cast<pid_t>(pid), 0) == 0 || errno == EPERM);
  }
};

// The holder's record, of several that of one which is alive here, or the last; empty if it is
// incomplete or something else.
Holder ReadHolder(int fd) {
  std::string text(kMaxHolderBytes, '\0');
  const ssize_t size = ::pread(fd, text.data(), text.size(), 0);
  text.resize(size > 0 ? static_cast<size_t>(size) : 0);
  Holder found;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line) && !found.AliveHere();) {
    try {
      const JsonValue value = ParseJson(line, "lock");
      found.host = value.At("host").AsString();
      found.start = value.At("start").AsString();
      found.pid = value.At("pid").AsInt();
    } catch (const Error&) {
    }
  }
  return found;
}

// The file may have been removed between open and flock.
bool StillInPlace(int fd, const std::string& path) {
  struct stat ours, there;
  return ::fstat(fd, &ours) == 0 && ::lstat(path.c_str(), &there) == 0 &&
         ours.st_dev == there.st_dev && ours.st_ino == there.st_ino;
}

}  // namespace

std::string OwnTemporary(const std::string& path) {
  return Concat(path, "-", HostName(), "-", ::getpid(), kTemporarySuffix);
}

FolderLock::FolderLock(const std::string& path, LockUse use) {
  const int kind = use == LockUse::kShared ? LOCK_SH : LOCK_EX;
  const std::string folder = std::filesystem::path(path).parent_path().parent_path().string();
  while (true) {
    fd_.Reset(OpenOwnFile(path, O_RDWR | O_CREAT));
    if (fd_.get() < 0) {
      const int error = errno;
      throw ResourceError(
          "cannot write here: " + FileProblem(error), path,
          FileRemedy(error, "choose another folder with --out, or correct its permissions"));
    }
    int status;
    do status = ::flock(fd_.get(), kind | LOCK_NB);
    while (status != 0 && errno == EINTR);
    if (status == 0 && StillInPlace(fd_.get(), path)) break;
    if (status != 0) {
      const int error = errno;
      const Holder holder = ReadHolder(fd_.get());
      if (error != EWOULDBLOCK)
        throw ResourceError(
            std::string("this file system cannot lock files: ") + std::strerror(error), path,
            "choose a folder on a local disk with --out");
      throw Error(ExitCode::kFolderInUse, "in use by " + holder.Text(), folder,
                  "wait for it or end it" +
                      (holder.AliveHere()
                           ? ""
                           : "; if that run has certainly ended (a network drive can keep its "
                             "lock), remove " +
                                 path));
    }
  }
  const std::string text = HolderText();
  const bool shared = use == LockUse::kShared;
  if (shared) ::fcntl(fd_.get(), F_SETFL, O_APPEND);
  if ((!shared && ::ftruncate(fd_.get(), 0) != 0) ||
      ::pwrite(fd_.get(), text.data(), text.size(), 0) != static_cast<ssize_t>(text.size())) {
    throw ResourceError(std::string("cannot write: ") + std::strerror(errno), path,
                        "free some space, or choose another folder with --out");
  }
}

}  // namespace regrade
