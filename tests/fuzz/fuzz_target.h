// What a fuzz target is: a reader of ours, inputs that it must accept, and a way to change them
// that gets past the reader's first checks.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/random.h"

namespace regrade::testing {

// Draws that are the same everywhere for the same seed.
class FuzzRandom {
 public:
  explicit FuzzRandom(uint64_t seed) : seed_(seed) {}
  uint64_t Bits() { return RandomBits(seed_, 55, counter_++); }
  // In {0, ..., n - 1}; n >= 1.
  size_t Below(size_t n) { return static_cast<size_t>(RandomIndex(seed_, 56, counter_++, n)); }
  bool Chance(double share) { return RandomDouble(seed_, 57, counter_++) < share; }

 private:
  uint64_t seed_, counter_ = 0;
};

struct FuzzTarget {
  const char* name;
  // Inputs that must be accepted: the corpus begins with them.
  std::vector<std::string> (*seeds)();
  // Hands the bytes to the reader. True if they were accepted and what came out is as the
  // reader guarantees, false if they were refused with an Error. Whatever is thrown is a
  // finding.
  bool (*read)(std::string_view bytes);
  // One mutant.
  std::string (*mutate)(std::string bytes, FuzzRandom* random);
  int mutants = 12000;  // that the replay test tries: half a second or so
};

inline std::ostream& operator<<(std::ostream& out, const FuzzTarget& target) {
  return out << target.name;
}

// By kind of file; each list stands in the file of its name.
std::vector<FuzzTarget> ArchiveTargets();
std::vector<FuzzTarget> ColmapTargets();
std::vector<FuzzTarget> CommandLineTargets();
std::vector<FuzzTarget> FieldTargets();
std::vector<FuzzTarget> FlowTargets();
std::vector<FuzzTarget> JsonTargets();
std::vector<FuzzTarget> PictureTargets();
std::vector<FuzzTarget> PoseTableTargets();
std::vector<FuzzTarget> RecordTargets();
std::vector<FuzzTarget> StateTargets();

template <typename... Lists>
std::vector<FuzzTarget> Joined(Lists... lists) {
  std::vector<FuzzTarget> all;
  for (const auto list : {lists...})
    for (const FuzzTarget& target : list()) all.push_back(target);
  return all;
}

// Readers that need little of the program to be built, and the others.
inline std::vector<FuzzTarget> ReaderTargets() {
  return Joined(ColmapTargets, ArchiveTargets, FieldTargets, JsonTargets, PoseTableTargets,
                PictureTargets);
}
inline std::vector<FuzzTarget> ProgramTargets() {
  return Joined(RecordTargets, FlowTargets, StateTargets, CommandLineTargets);
}

}  // namespace regrade::testing
