// If no file descriptor is left, the error is about the limit, not about the files.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "pipeline/files/atomic_file.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/files/npz_file.h"
#include "pipeline/workspace/stage_record.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

// No further file can be opened during its lifetime.
class NoFilesLeft {
 public:
  NoFilesLeft() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const rlimit none{3, before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoFilesLeft() { ::setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_;
};

TEST(FewFiles, F25_TheLimitIsNamedAndTheFilesAreNotBlamed) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "the sanitizer reads its own maps from files, and finds faults without them";
#endif
  const testing::TemporaryFolder folder;
  testing::WriteText(folder / "photos/a.png", "x");
  testing::WriteText(folder / "a.npz", "x");
  NpzWriter writer;
  writer.AddScalar<int32_t>("one", 1);
  writer.WriteTo(folder / "one.npz");
  EXPECT_EQ(ListFolder(folder / "photos").files.size(), 1u);
  const NoFilesLeft none;
  const char* reason = "Too many open files";
  EXPECT_REGRADE_ERROR(ListFolder(folder / "photos"), ExitCode::kResources, reason);
  EXPECT_REGRADE_ERROR(ReadWholeFile(folder / "a.npz", 100), ExitCode::kResources, reason);
  EXPECT_REGRADE_ERROR(NpzReader(folder / "one.npz", 100), ExitCode::kResources, reason);
  EXPECT_REGRADE_ERROR(WriteFileAtomically(folder / "b", "x"), ExitCode::kResources, reason);
}

}  // namespace
}  // namespace regrade
