// A fuzz target without a fuzzer: its seeds, what was found before, and some thousand mutants
// that are the same everywhere.
#pragma once

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/fuzz_target.h"

namespace regrade::testing {

inline constexpr double kLongest = 5;     // seconds an input may take
inline constexpr long kMostMemory = 512;  // MiB
inline constexpr size_t kKept = 64;       // accepted mutants that further ones are made of

// The first bytes as hexadecimal digits.
std::string Hex(const std::string& bytes);
// Of lines of hexadecimal digits; '#' begins a line of words.
std::string FromHex(const std::string& text);
// The largest memory that this process has had, MiB.
long PeakMemory();

class FuzzReplay : public ::testing::TestWithParam<FuzzTarget> {
 protected:
  void SetUp() override { omp_set_num_threads(1); }

  // Whether the input was accepted; anything but yes and no fails the test.
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
};

TEST_P(FuzzReplay, SeedsFindsAndMutants) {
  const FuzzTarget& target = GetParam();
  std::vector<std::string> kept = target.seeds();
  const size_t seeds = kept.size();
  for (size_t i = 0; i < seeds; ++i)
    EXPECT_TRUE(Read(kept[i], "seed " + std::to_string(i))) << "a good input was refused";

  const std::filesystem::path finds =
      std::filesystem::path(REGRADE_SOURCE_DIR) / "tests/fuzz/found" / target.name;
  if (std::filesystem::is_directory(finds))
    for (const auto& entry : std::filesystem::directory_iterator(finds))
      Read(FromHex(ReadText(entry.path())), entry.path().filename());

  int accepted = 0;
  for (int i = 0; i < target.mutants && !HasFailure(); ++i) {
    FuzzRandom random(static_cast<uint64_t>(i));
    const std::string& base = kept[random.Below(random.Chance(0.5) ? seeds : kept.size())];
    std::string mutant = target.mutate(base, &random);
    if (!Read(mutant, "mutant " + std::to_string(i))) continue;
    ++accepted;
    if (kept.size() < seeds + kKept)
      kept.push_back(std::move(mutant));
    else
      kept[seeds + random.Below(kKept)] = std::move(mutant);
  }
  // Mutants that are all refused would show the reader's first line only.
  EXPECT_GT(accepted, target.mutants / 100) << "of " << target.mutants;
#if !defined(__SANITIZE_ADDRESS__)
  EXPECT_LT(PeakMemory(), kMostMemory);
#endif
}

}  // namespace regrade::testing
