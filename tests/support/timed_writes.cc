// A library to preload: counts and times the calls that make writes durable.
//
//   TIMED_WRITES_REPORT   file; each process appends a line "NAME CALLS SECONDS" for each call
//
// Operations are: fsync and fdatasync (of files and folders), rename.
#include <dlfcn.h>
#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>

namespace {

struct Tally {
  const char* name;
  std::atomic<long> calls{0}, nanoseconds{0};
};
Tally syncs{"fsync"}, renames{"rename"};

long Now() {
  timespec now;
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000000L + now.tv_nsec;
}

template <typename Call>
int Timed(Tally* tally, const Call& call) {
  const long begin = Now();
  const int result = call();
  tally->nanoseconds += Now() - begin;
  ++tally->calls;
  return result;
}

template <typename Function>
Function Real(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

__attribute__((destructor)) void Report() {
  const char* path = getenv("TIMED_WRITES_REPORT");
  if (path == nullptr) return;
  std::FILE* file = std::fopen(path, "a");
  if (file == nullptr) return;
  for (const Tally* tally : {&syncs, &renames})
    std::fprintf(file, "%s %ld %.6f\n", tally->name, tally->calls.load(),
                 1e-9 * static_cast<double>(tally->nanoseconds.load()));
  std::fclose(file);
}

}  // namespace

extern "C" {

int fsync(int fd) {
  return Timed(&syncs, [fd] { return Real<int (*)(int)>("fsync")(fd); });
}

int fdatasync(int fd) {
  return Timed(&syncs, [fd] { return Real<int (*)(int)>("fdatasync")(fd); });
}

int rename(const char* from, const char* to) {
  return Timed(&renames, [from, to] {
    return Real<int (*)(const char*, const char*)>("rename")(from, to);
  });
}

}  // extern "C"
