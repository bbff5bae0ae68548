#include "pipeline/files/npz_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>

#include "kernels/base/random.h"
#include "pipeline/files/atomic_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_archive.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::BytesOf;
using testing::SmallArchive;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr uint64_t kBudget = 1 << 20;

void ReadEverything(const std::string& path) {
  NpzReader reader(path, kBudget);
  for (const std::string& name : reader.names()) reader.Read(name);
}

std::string Patched(std::string bytes, size_t at, uint64_t value, int size) {
  for (int i = 0; i < size; ++i, value >>= 8) bytes[at + i] = static_cast<char>(value & 255);
  return bytes;
}

TEST(Npz, RoundTrip) {
  const TemporaryFolder folder;
  WriteText(folder / "a.npz", SmallArchive());
  NpzReader reader(folder / "a.npz", kBudget);
  const NpzArray values = reader.Read("values", ArrayType::kF32, {2, -1});
  EXPECT_EQ(values.shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(values.As<float>()[5], 6);
  EXPECT_EQ(reader.Read("ramp").As<int32_t>()[999], 7);
  EXPECT_EQ(reader.ReadScalar<double>("pi"), 3.25);
  EXPECT_EQ(reader.ReadText("note"), "h\xc3\xa9llo");
  EXPECT_REGRADE_ERROR(reader.Read("none"), ExitCode::kInput, "'none'");
  EXPECT_REGRADE_ERROR(reader.Read("values", ArrayType::kF32, {3, 2}), ExitCode::kInput,
                       "(2, 3), expected <f4(3, 2)");
}

TEST(Npz, UnsignedNumbersOf64BitsKeepTheirTop) {
  const TemporaryFolder folder;
  const uint64_t keys[3] = {0, uint64_t{1} << 63, ~uint64_t{0}};
  NpzWriter writer;
  writer.Add("keys", {3}, keys, NpzPacking::kDeflate);
  writer.WriteTo(folder / "a.npz");
  NpzReader reader(folder / "a.npz", kBudget);
  const NpzArray array = reader.Read("keys", ArrayType::kU64, {3});
  EXPECT_STREQ(NameOf(array.type), "<u8");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(array.As<uint64_t>()[i], keys[i]);
  EXPECT_REGRADE_ERROR(reader.Read("keys", ArrayType::kI64, {3}), ExitCode::kInput, "<u8(3)");
}

TEST(Npz, SameArraysSameBytesOnAnyDay) {
  const std::string bytes = SmallArchive();
  EXPECT_EQ(bytes, SmallArchive());
  // Every local header carries midnight of 1980-01-01.
  for (size_t at = bytes.find("PK\x03\x04"); at != std::string::npos;
       at = bytes.find("PK\x03\x04", at + 4))
    EXPECT_EQ(bytes.substr(at + 10, 4), std::string("\0\0\x21\0", 4));
}

TEST(Npz, EmptyArrays) {
  const TemporaryFolder folder;
  NpzWriter writer;
  writer.Add<float>("none", {0, 27}, nullptr);
  writer.WriteTo(folder / "a.npz");
  NpzReader reader(folder / "a.npz", kBudget);
  EXPECT_EQ(reader.Read("none").shape, (std::vector<int64_t>{0, 27}));
}

// Rows are made while the file is written, in pieces of several megabytes.
TEST(Npz, FilledRowsAreTheArray) {
  const TemporaryFolder folder;
  constexpr int64_t kRows = 2'500'000, kColumns = 3;
  std::vector<float> whole(kRows * kColumns);
  for (size_t i = 0; i < whole.size(); ++i) whole[i] = static_cast<float>(i % 1000);
  for (const NpzPacking packing : {NpzPacking::kStore, NpzPacking::kDeflate}) {
    int64_t next = 0;
    NpzWriter filled, plain;
    filled.AddFilled<float>(
        "a", {kRows, kColumns},
        [&](int64_t first, int64_t rows, float* to) {
          EXPECT_EQ(first, next);
          next = first + rows;
          std::copy_n(whole.data() + first * kColumns, rows * kColumns, to);
        },
        packing);
    filled.AddFilled<float>("none", {0, 4}, [](int64_t, int64_t, float*) { FAIL(); });
    plain.Add("a", {kRows, kColumns}, whole.data(), packing);
    plain.Add<float>("none", {0, 4}, nullptr);
    filled.WriteTo(folder / "filled.npz");
    plain.WriteTo(folder / "plain.npz");
    EXPECT_EQ(next, kRows);
    EXPECT_EQ(ReadWholeFile(folder / "filled.npz", 1 << 30),
              ReadWholeFile(folder / "plain.npz", 1 << 30));

    NpzReader reader(folder / "plain.npz", 1 << 30);
    int64_t read = 0, times = 0;
    reader.ReadRows("a", [&](int64_t first, const NpzArray& rows) {
      ++times;
      ASSERT_EQ(first, read);
      ASSERT_EQ(rows.shape.size(), 2u);
      ASSERT_TRUE(std::equal(rows.As<float>(), rows.As<float>() + rows.num_elements(),
                             whole.data() + first * kColumns));
      read += rows.shape[0];
    });
    EXPECT_EQ(read, kRows);
    EXPECT_GT(times, 2);
    int taken = 0;
    reader.ReadRows("none", [&](int64_t, const NpzArray& rows) {
      ++taken;
      EXPECT_EQ(rows.shape, (std::vector<int64_t>{0, 4}));
    });
    EXPECT_EQ(taken, 1);
    NpzReader small(folder / "plain.npz", 1 << 20);
    EXPECT_THROW(small.ReadRows("a", [](int64_t, const NpzArray&) { FAIL(); }), Error);
  }
}

// WriteTo rethrows the exception of a fill function, and the old file stays.
TEST(Npz, AFailureWhileWritingKeepsTheOldFile) {
  const TemporaryFolder folder;
  WriteText(folder / "a.npz", "old");
  NpzWriter writer;
  writer.AddFilled<float>("a", {4}, [](int64_t, int64_t, float*) {
    throw Error(ExitCode::kInput, "no such row", "there");
  });
  EXPECT_REGRADE_ERROR(writer.WriteTo(folder / "a.npz"), ExitCode::kInput, "no such row");
  EXPECT_EQ(ReadWholeFile(folder / "a.npz", 100), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
  EXPECT_REGRADE_ERROR(writer.WriteTo(folder / "none/a.npz"), ExitCode::kResources,
                       "none/a.npz");
}

// A full disk: the error names the file, and neither it nor a temporary is left.
TEST(Npz, AFullDiskNamesTheFile) {
  const TemporaryFolder folder;
  const std::vector<float> values(1 << 20, 1.f);
  NpzWriter writer;
  writer.Add("a", {1 << 20}, values.data());
  rlimit before;
  ::getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{1 << 20, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_REGRADE_ERROR(writer.WriteTo(folder / "a.npz"), ExitCode::kResources, "a.npz");
  ::setrlimit(RLIMIT_FSIZE, &before);
  ::signal(SIGXFSZ, handler);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// An archive that is cut anywhere is refused.
TEST(Npz, F71_TruncatedAnywhere) {
  const TemporaryFolder folder;
  const std::string bytes = SmallArchive();
  for (size_t size = 0; size < bytes.size(); size += 3) {
    WriteText(folder / "a.npz", bytes.substr(0, size));
    EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "a.npz");
  }
}

// The checksum detects a flipped bit of the data; any other bit is detected or does not matter.
// Only Error may be thrown.
TEST(Npz, F70_FlippedBits) {
  const TemporaryFolder folder;
  const std::string bytes = SmallArchive();
  int refused = 0;
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string mutant = bytes;
    mutant[i] ^= static_cast<char>(1 << i % 8);
    WriteText(folder / "a.npz", mutant);
    try {
      ReadEverything(folder / "a.npz");
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, static_cast<int>(bytes.size() / 2));
  std::string damaged = bytes;
  damaged[bytes.find(std::string("\0\0\x80\x3f", 4))] ^= 1;  // the first stored float
  WriteText(folder / "a.npz", damaged);
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "'values'");
}

TEST(Npz, F66_SizesAboveTheBudget) {
  const TemporaryFolder folder;
  WriteText(folder / "a.npz", SmallArchive());
  NpzReader reader(folder / "a.npz", 500);
  EXPECT_REGRADE_ERROR(reader.Read("ramp"), ExitCode::kInput, "more than the 500");
  reader.Read("values");
  EXPECT_REGRADE_ERROR(  // one budget for all
      {
        for (int i = 0; i < 5; ++i) reader.Read("values");
      },
      ExitCode::kInput, "--max-memory");
}

TEST(Npz, F71_DeflateRatioAndStoredSizes) {
  const TemporaryFolder folder;
  const std::string bytes = SmallArchive();
  const size_t central = bytes.find("PK\x01\x02");
  const size_t second = bytes.find("PK\x01\x02", central + 4);
  const size_t second_local = bytes.find("PK\x03\x04", 4);
  // Both headers agree on a size that deflate cannot reach.
  std::string bomb = Patched(bytes, second + 24, 1u << 30, 4);
  bomb = Patched(bomb, second_local + 22, 1u << 30, 4);
  WriteText(folder / "a.npz", bomb);
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput,
                       "more than deflate can do");
  WriteText(folder / "a.npz", Patched(Patched(bytes, central + 24, 1000, 4), 22, 1000, 4));
  // By its two sizes, or, where libzip is newer, by libzip.
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput,
                       "the file is damaged or malicious");
  // The two headers disagree.
  WriteText(folder / "a.npz", Patched(bytes, second_local + 22, 4000, 4));
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "disagree");
}

TEST(Npz, F67_OverlappingMembers) {
  const TemporaryFolder folder;
  // Two names for one member.
  static const float values[6] = {1, 2, 3, 4, 5, 6};
  NpzWriter writer;
  for (const char* name : {"a", "b", "c"}) writer.Add(name, {6}, values);
  const std::string whole = BytesOf(writer);
  std::string bytes = whole;
  const size_t central = bytes.find("PK\x01\x02", bytes.find("PK\x01\x02") + 4);
  bytes = Patched(bytes, central + 42, 0, 4);  // b's local header is a's
  bytes[central + 46] = 'a';
  WriteText(folder / "a.npz", bytes);
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "twice");
  // Each member claims the bytes of all that follow it, and all headers agree.
  bytes = whole;
  const size_t directory = bytes.find("PK\x01\x02");
  size_t local = 0, entry = directory;
  for (int i = 0; i < 3; ++i) {
    constexpr size_t kLocalHeader = 30, kName = 5;
    const size_t size = directory - local - kLocalHeader - kName;
    for (const size_t at : {local + 18, local + 22, entry + 20, entry + 24})
      bytes = Patched(bytes, at, size, 4);
    local = whole.find("PK\x03\x04", local + 4);
    entry = whole.find("PK\x01\x02", entry + 4);
  }
  WriteText(folder / "a.npz", bytes);
  EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "share bytes");
}

TEST(Npz, F71_OffsetsOutsideTheFile) {
  const TemporaryFolder folder;
  const std::string bytes = SmallArchive();
  const size_t central = bytes.find("PK\x01\x02");
  for (const uint64_t offset :
       {uint64_t{0xfffffff0}, uint64_t{bytes.size() - 3}, uint64_t{1}}) {
    WriteText(folder / "a.npz", Patched(bytes, central + 42, offset, 4));
    EXPECT_REGRADE_ERROR(ReadEverything(folder / "a.npz"), ExitCode::kInput, "zip archive");
  }
}

std::string Npy(const std::string& dictionary) {
  std::string bytes = std::string("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(dictionary.size() & 255);
  bytes += static_cast<char>(dictionary.size() >> 8);
  return bytes + dictionary;
}

TEST(NpyHeader, ReadsWhatNumPyWrites) {
  const NpyHeader header = ParseNpyHeader(
      Npy("{'descr': '<f2', 'fortran_order': False, 'shape': (10, 27), }     \n"), "x");
  EXPECT_EQ(header.type, ArrayType::kF16);
  EXPECT_EQ(header.shape, (std::vector<int64_t>{10, 27}));
  EXPECT_EQ(header.data_bytes, 540u);
  EXPECT_EQ(ParseNpyHeader(Npy("{'descr': '<i8', 'fortran_order': False, 'shape': (), }"), "x")
                .data_bytes,
            8u);
  const std::string ours = MakeNpyHeader(ArrayType::kF32, {3, 4});
  EXPECT_EQ(ours.size() % 64, 0u);
  EXPECT_EQ(ParseNpyHeader(ours, "x").data_offset, ours.size());
}

TEST(NpyHeader, F72_RefusedByName) {
  const auto with = [](const std::string& type, const std::string& order,
                       const std::string& shape) {
    return Npy("{'descr': " + type + ", 'fortran_order': " + order + ", 'shape': " + shape +
               ", }\n");
  };
  const struct {
    std::string bytes;
    const char* reason;
  } cases[] = {
      {with("'>f4'", "False", "(3,)"), "big-endian"},
      {with("'|O'", "False", "(3,)"), "Python objects"},
      {with("''", "False", "(3,)"), "element type ''"},
      {with("[('a', '<f4')]", "False", "(3,)"), "structured"},
      {with("'<U5'", "False", "(3,)"), "<U5"},
      {with("'<f4'", "True", "(3, 2)"), "Fortran"},
      {with("'<f4'", "False", "(-3,)"), "not a length"},
      {with("'<f4'", "False", "(4294967296, 4294967296)"), "too large"},
      {with("'<f4'", "False", "(99999999999999999999,)"), "not a length"},
      {with("'<f4'", "False", "(1,1,1,1,1,1,1,1,1)"), "8 axes"},
      {with("'<f4'", "False", "(3,"), ""},
      {with("'<f4'", "__import__('os')", "(3,)"), "True or False"},
      {Npy("{'descr': '<f4'}"), "missing"},
      {Npy("{'descr': '<f4', 'descr': '<f4'}"), "twice"},
      {Npy("{'other': 1}"), "unknown key"},
      {Npy("{'descr': '<f4', 'fortran_order': False, 'shape': (3,)} x"), "follows"},
      {std::string("\x93NUMPY\x01\x00\xff\xff{", 11), "longer than the file"},
      {"\x93NUMPY\x09", "not a NumPy array"},
      {"not an array at all", "not a NumPy array"},
  };
  for (const auto& c : cases)
    EXPECT_REGRADE_ERROR(ParseNpyHeader(c.bytes, "file"), ExitCode::kInput, c.reason);
}

}  // namespace
}  // namespace regrade
