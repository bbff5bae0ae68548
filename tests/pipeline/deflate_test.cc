// Bytes compressed in parts come back, and are the same with any number of threads.
#include "pipeline/files/deflate.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <string>

#include "kernels/base/random.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

// Small numbers with long repetitions, so that a part refers to the end of the one before.
std::string SomeBytes(size_t size) {
  std::string bytes(size, '\0');
  for (size_t i = 0; i < size; ++i)
    bytes[i] = i % 5000 < 4000
                   ? static_cast<char>(i % 4000 / 7)
                   : static_cast<char>(8 * RandomDouble(3, 1, static_cast<uint64_t>(i)));
  return bytes;
}

TEST(Deflate, BytesOfSeveralPartsComeBack) {
  constexpr size_t kPart = size_t{8} << 20;
  for (const size_t size :
       {size_t{0}, size_t{1}, size_t{1000}, kPart - 1, kPart, kPart + 1, 2 * kPart + 12345}) {
    const std::string bytes = SomeBytes(size), packed = Deflate(bytes);
    EXPECT_TRUE(Inflate(packed, size, "test") == bytes) << size;
    EXPECT_LT(packed.size(), size / 2 + 100);
    EXPECT_TRUE(Gunzip(Gzip(bytes), size, "test") == bytes) << size;
  }
}

TEST(Deflate, ThreadsDoNotChangeABit) {
  const std::string bytes = SomeBytes(size_t{20} << 20);
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const std::string alone = Deflate(bytes);
  omp_set_num_threads(3);
  EXPECT_TRUE(Deflate(bytes) == alone);
  omp_set_num_threads(before);
}

TEST(Deflate, AGzipFileIsUnpacked) {
  // What Python's gzip.compress makes of "splats".
  constexpr unsigned char kPacked[] = {31, 139, 8,  0, 0, 0,   0,  0,  2,   3, 43, 46, 200,
                                       73, 44,  41, 6, 0, 219, 75, 28, 127, 6, 0,  0,  0};
  std::string packed(std::begin(kPacked), std::end(kPacked));
  EXPECT_EQ(Gunzip(packed, 6, "test"), "splats");
  EXPECT_REGRADE_ERROR(Gunzip(packed, 5, "test"), ExitCode::kInput, "more than 5");
  EXPECT_REGRADE_ERROR(Inflate(packed, 6, "test"), ExitCode::kInput, "damaged");
  packed[18] = 'x';  // of the checksum
  EXPECT_REGRADE_ERROR(Gunzip(packed, 6, "test"), ExitCode::kInput, "damaged");
}

TEST(Deflate, DamageIsRefused) {
  std::string packed = Deflate(SomeBytes(100000));
  EXPECT_REGRADE_ERROR(Inflate(packed, 99999, "test"), ExitCode::kInput, "more than 99999");
  EXPECT_REGRADE_ERROR(Inflate(packed + "x", 100000, "test"), ExitCode::kInput, "damaged");
  packed.back() ^= 1;  // of the checksum
  EXPECT_REGRADE_ERROR(Inflate(packed, 100000, "test"), ExitCode::kInput, "damaged");
}

}  // namespace
}  // namespace regrade
