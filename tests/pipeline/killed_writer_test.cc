// Files that a killed process was writing.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include "pipeline/files/atomic_file.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr size_t kPayload = 2 << 20;

// Whether `path` is one of the payloads, whole.
bool Whole(const std::string& path) {
  const std::string text = ReadText(path);
  return text.size() == kPayload && text.find_first_not_of(text[0]) == std::string::npos;
}

// Kills a process that rewrites a file in a loop, at random instants after it has begun; counts
// torn files, and ends after `enough` of them.
template <typename WriteOnce>
int TornAfterKills(const std::string& path, int kills, int enough,
                   const WriteOnce& write_once) {
  WriteFileAtomically(path, std::string(kPayload, 'a'));
  int torn = 0;
  for (int i = 0; i < kills && torn < enough; ++i) {
    int begun[2];
    EXPECT_EQ(::pipe(begun), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      if (::write(begun[1], "b", 1) != 1) ::_exit(1);
      for (char c = 'a';; c = static_cast<char>(c == 'z' ? 'a' : c + 1))
        write_once(path, std::string(kPayload, c));
    }
    char byte = 0;
    EXPECT_EQ(::read(begun[0], &byte, 1), 1);
    ::close(begun[0]);
    ::close(begun[1]);
    std::this_thread::sleep_for(std::chrono::microseconds(2000 + (i * 7919) % 9000));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    torn += !Whole(path);
  }
  return torn;
}

TEST(AtomicFile, F35_KilledAtAnyInstantNothingIsTorn) {
  const TemporaryFolder folder;
  EXPECT_EQ(TornAfterKills(folder / "a", 40, 40,
                           [](const std::string& path, const std::string& text) {
                             WriteFileAtomically(path, text);
                           }),
            0);
  // The same loop detects a writer that rewrites in place; on a loaded machine a process may be
  // killed before it has run for as long as one write takes.
  EXPECT_GT(TornAfterKills(folder / "b", 1000, 1,
                           [](const std::string& path, const std::string& text) {
                             WriteText(path, text);
                           }),
            0);
}

}  // namespace
}  // namespace regrade
