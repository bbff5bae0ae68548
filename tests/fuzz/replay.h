// Runs a fuzz target without a fuzzer: its seeds, earlier findings, and some thousand
// deterministic mutants.
#pragma once

#include <gtest/gtest.h>
#include <omp.h>

#include <chrono>

#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/fuzz_target.h"

namespace regrade::testing {

inline constexpr double kLongest = 5;     // seconds an input may take
inline constexpr long kMostMemory = 512;  // MiB
inline constexpr size_t kKept = 64;       // accepted mutants that are mutated further

// The first bytes as hexadecimal digits.
std::string Hex(const std::string& bytes);
// Parses lines of hexadecimal digits; '#' begins a comment.
std::string FromHex(const std::string& text);
// Maximum memory of this process, MiB.
long PeakMemory();

class FuzzReplay : public ::testing::TestWithParam<FuzzTarget> {
 protected:
  void SetUp() override { omp_set_num_threads(1); }

  // True if the input was accepted; an exception fails the test.
  bool Read(const std::string& bytes, const std::string& name) {
    const auto begin = std::chrono::steady_clock::now();
    bool accepted = false;
    try {
      accepted = GetParam().read(bytes);
    } catch (const Error& error) {
      ADD_FAILURE() << name << " was refused too late: " << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << name << ": " << error.what() << "\n" << Hex(bytes);
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    EXPECT_LT(took.count(), kLongest) << name << "\n" << Hex(bytes);
    return accepted;
  }
  // The body of the replay test.
  void ReadSeedsFindsAndMutants();
};

}  // namespace regrade::testing
