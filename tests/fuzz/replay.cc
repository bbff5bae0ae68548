// Runs seeds, earlier findings and mutants; reads inputs as text, and measures memory.
#include "tests/fuzz/replay.h"

#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/source_dir.h"

namespace regrade::testing {
namespace {

constexpr size_t kShown = 300;  // bytes of an input in a failure's message

}  // namespace

std::string Hex(const std::string& bytes) {
  std::string text;
  char two[3];
  for (const char c : bytes.substr(0, kShown)) {
    std::snprintf(two, sizeof two, "%02x", static_cast<unsigned char>(c));
    text += two;
  }
  return text + (bytes.size() > kShown ? "..." : "");
}

std::string FromHex(const std::string& text) {
  std::string bytes, digits;
  bool words = false;
  for (const char c : text) {
    words = c != '\n' && (words || c == '#');
    if (words || std::string_view(" \n\r").find(c) != std::string_view::npos) continue;
    digits += c;
    if (digits.size() < 2) continue;
    bytes += static_cast<char>(std::stoi(digits, nullptr, 16));
    digits.clear();
  }
  return bytes;
}

long PeakMemory() {
  rusage usage;
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss >> 10;
}

void FuzzReplay::ReadSeedsFindsAndMutants() {
  const FuzzTarget& target = GetParam();
  std::vector<std::string> kept = target.seeds();
  const size_t seeds = kept.size();
  for (size_t i = 0; i < seeds; ++i)
    EXPECT_TRUE(Read(kept[i], "seed " + std::to_string(i))) << "a good input was refused";

  const std::filesystem::path finds =
      std::filesystem::path(SourceDir()) / "tests/fuzz/found" / target.name;
  if (std::filesystem::is_directory(finds))
    for (const auto& entry : std::filesystem::directory_iterator(finds))
      Read(FromHex(ReadText(entry.path())), entry.path().filename());

  const char* const wanted = std::getenv("REGRADE_FUZZ_MUTANTS");
  const int mutants = wanted != nullptr ? std::atoi(wanted) : target.mutants;
  int accepted = 0;
  for (int i = 0; i < mutants && !HasFailure(); ++i) {
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
  // If all mutants were refused, only the reader's first check would be tested.
  EXPECT_GT(accepted, mutants / 100) << "of " << mutants;
#if !defined(__SANITIZE_ADDRESS__)
  EXPECT_LT(PeakMemory(), kMostMemory);
#endif
}

}  // namespace regrade::testing
